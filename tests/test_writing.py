"""Files written whole or not at all; nothing harmed that is no older output."""

import errno
import os
import stat

import pytest

from quietbus import writing
from quietbus.writing import OutputError, check_target, replacing, write_json, write_text

KIND = "disturbance block (YAML)"
OLD, NEW = "disturbance: old\n", "disturbance: new\n"


def test_older_output_is_replaced_and_its_permissions_stay(tmp_path):
    target = tmp_path / "a.yaml"
    write_text(target, OLD, KIND)
    target.chmod(0o640)
    write_text(target, NEW, KIND)
    assert target.read_text() == NEW
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


def test_new_file_has_the_permissions_that_the_user_s_mask_leaves(tmp_path):
    mask = os.umask(0o027)
    try:
        write_text(tmp_path / "a.yaml", NEW, KIND)
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "a.yaml").stat().st_mode) == 0o640


def _folder(path):
    path.mkdir()


def _link(path):
    (path.parent / "victim").write_text(OLD)
    path.symlink_to("victim")


def _dangling(path):
    path.symlink_to("nowhere")


def _protected(path):
    path.write_text(OLD)
    path.chmod(0o444)


@pytest.mark.parametrize(
    ("occupy", "said"),
    [
        (_folder, "is a folder"),
        (_link, "is a link to victim"),
        (_dangling, "is a link to nowhere"),
        (os.mkfifo, "is a pipe, socket or device"),
        (_protected, "is write-protected"),
        (lambda path: path.write_text("name: mine\n"), "exists and is no disturbance block"),
    ],
)
def test_what_is_no_older_output_stays_as_it_is(tmp_path, occupy, said):
    target = tmp_path / "a.yaml"
    occupy(target)
    before = [(path.name, path.lstat()) for path in sorted(tmp_path.iterdir())]
    for use in (lambda: check_target(target, KIND), lambda: write_text(target, NEW, KIND)):
        with pytest.raises(OutputError, match=said):
            use()
    after = [(path.name, path.lstat()) for path in sorted(tmp_path.iterdir())]
    identity = lambda found: [(n, s.st_ino, s.st_mode, s.st_size, s.st_mtime) for n, s in found]  # noqa: E731
    assert identity(after) == identity(before)


@pytest.mark.parametrize("name", ["a\0b", "x" * 256, "ü" * 128])
def test_names_that_cannot_be_are_refused(tmp_path, name):
    with pytest.raises(OutputError, match="cannot be the name of a file"):
        check_target(tmp_path / name, KIND)


def test_name_of_full_length_is_written(tmp_path):
    """The name beside it, under which it is written first, is no longer than any."""
    write_text(tmp_path / ("x" * 255), NEW, KIND)
    assert (tmp_path / ("x" * 255)).read_text() == NEW


def test_device_is_refused():
    with pytest.raises(OutputError, match="/dev/null: is a pipe, socket or device"):
        check_target("/dev/null", KIND)


def test_prepared_link_under_the_new_name_is_not_followed(tmp_path, monkeypatch):
    """Even if someone foresaw the name."""
    monkeypatch.setattr(writing.secrets, "token_hex", lambda _: "foreseen")
    (tmp_path / "victim").write_text("precious")
    (tmp_path / ".quietbus-foreseen.part").symlink_to("victim")
    with pytest.raises(OutputError, match="File exists"):
        write_text(tmp_path / "a.yaml", NEW, KIND)
    assert (tmp_path / "victim").read_text() == "precious"


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.yaml"
    write_text(target, OLD, KIND)

    def fill():
        with replacing(target, KIND) as file:
            file.write(b"disturb")
            raise OSError(errno.ENOSPC, "as of a full disk")

    with pytest.raises(OutputError, match=r"a\.yaml: cannot be written: No space left on device"):
        fill()
    assert target.read_text() == OLD
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


def test_json_holds_no_numbers_that_are_none(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "a.json", {"x": float("nan")})
    assert not list(tmp_path.iterdir())
