"""Files of runs on disks that become full."""

import errno
import resource

import pytest

import quietbus as qb
from quietbus.results import files
from quietbus.writing import OutputError
from results.synthetic import synthetic


@pytest.fixture(scope="module")
def run():
    return synthetic()


def test_run_comes_back_from_its_file_as_it_was(run, tmp_path):
    qb.save_run(run, tmp_path / "run.nc")
    assert qb.load_run(tmp_path / "run.nc").identical(run)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.05, 0.5, 0.99, 0.9999])
def test_file_that_grows_too_large_is_told_and_leaves_the_older_run(run, tmp_path, share):
    """The system's own refusal, as of a full disk; HDF5 would end in a segmentation fault."""
    target = tmp_path / "run.nc"
    older = synthetic(50)
    qb.save_run(run, target)
    limit = int(share * target.stat().st_size)
    qb.save_run(older, target)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(OutputError, match=r"run\.nc: cannot be written: the size that files"):
            qb.save_run(run, target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert qb.load_run(target).identical(older)
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]


def test_any_write_may_fail(tmp_path, monkeypatch):
    """A disk that is full from the n-th write on, for many n."""
    run, count = synthetic(5), 0
    write = files._Disk._put

    def counted(self, start, data):
        nonlocal count
        count += 1
        if count > allowed:
            raise OSError(errno.ENOSPC, "full")
        write(self, start, data)

    monkeypatch.setattr(files._Disk, "_put", counted)
    allowed = 10**9
    qb.save_run(run, tmp_path / "run.nc")
    writes, failed = count, 0
    for allowed in {*range(0, writes, 9), writes - 1}:  # noqa: B007
        count = 0
        with pytest.raises(OutputError, match="No space left on device"):
            qb.save_run(run, tmp_path / "run.nc")
        failed += 1
    assert failed > writes // 9 > 4
    assert qb.load_run(tmp_path / "run.nc").identical(run)
