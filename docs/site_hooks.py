"""What MkDocs does for this site beyond its plugins; see ``hooks`` in mkdocs.yml."""

import html
import re
from pathlib import Path
from xml.etree import ElementTree

from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = Path(__file__).parents[1]
FROM_ROOT = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "LICENSE": "license.txt",
}
_LINK = re.compile(r"(?<=\]\()[^)\s]+(?=\))")
_MATHS = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
_CODE = re.compile(r"<code.*?</code>", re.DOTALL)
_TAG = re.compile(r"\\tag\{(\w+)\}")
_PAIRS = {r"(?<!\\)\{": r"(?<!\\)\}", r"\\left\b": r"\\right\b", r"\\begin\b": r"\\end\b"}
_NAMESPACE = "{http://www.w3.org/1998/Math/MathML}"
_APPLY, _THIN = "\u2061", "0.167em"
ElementTree.register_namespace("", _NAMESPACE[1:-1])


def on_config(config):
    """A folder in the navigation stands for its pages, in the order of their file names."""
    config.nav = [_listed(item, Path(config.docs_dir)) for item in config.nav]
    return config


def _listed(item, docs):
    ((title, target),) = item.items()
    if not target.endswith("/"):
        return item
    pages = sorted(docs.glob(f"{target}*.md"), key=lambda page: _number(page.name))
    return {title: [page.relative_to(docs).as_posix() for page in pages]}


def _number(name):
    """9 of 9-reproduce.md, so that it comes before 10."""
    return int(name.partition("-")[0]), name


def on_files(files, config):
    """The home page, the changelog and the licence are those of the repository, links adapted."""
    for name, page in FROM_ROOT.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        if name.endswith(".md"):
            text = _LINK.sub(lambda link: _on_site(link[0]), text)
        files.append(File.generated(config, page, content=text))
    return files


def _on_site(link):
    path, anchor, heading = link.partition("#")
    return FROM_ROOT.get(path, path.removeprefix("docs/")) + anchor + heading


def on_page_content(content, page, **_):
    """TeX to MathML, which browsers show without a script; an error stops the build."""

    def mathml(found):
        display, latex = found[1] == "div", html.unescape(found[2])
        number = _TAG.search(latex)
        try:
            for begin, end in _PAIRS.items():  # which docutils lets pass
                if len(re.findall(begin, latex)) != len(re.findall(end, latex)):
                    raise MathError(f"unequal numbers of {begin} and {end}")
            math = _spaced(tex2mathml(_TAG.sub("", latex), as_block=display))
        except MathError as error:
            raise PluginError(f"{page.file.src_uri}: {error}\n{latex}") from None
        if not display:
            return math
        if not number:
            return f'<div class="equation">{math}</div>'
        name = f"eq-{number[1]}"
        return f'<div class="equation" id="{name}">{math}<a href="#{name}">({number[1]})</a></div>'

    content = _MATHS.sub(mathml, content)
    left = re.search(r".*\$.*", _CODE.sub("", content))
    if left:
        raise PluginError(f"{page.file.src_uri}: a $ that begins or ends no formula: {left[0]}")
    return content


def _spaced(mathml):
    """An index beside an accented letter, where docutils has it below; room around sin, cos..."""
    tree = ElementTree.fromstring(mathml.replace("&ApplyFunction;", _APPLY))
    for node in list(tree.iter()):
        if _local(node) == "munderover" and node[2].get("stretchy") == "false":
            base, index, accent = node
            accented = ElementTree.Element(f"{_NAMESPACE}mover", accent="true")
            accented.extend([base, accent])
            node[:] = [accented, index]
            node.tag = f"{_NAMESPACE}msub"
        for i, child in reversed(list(enumerate(node))):
            if child.text == _APPLY:
                if node[i + 1].text not in ("(", "["):
                    child.set("rspace", _THIN)
                if i > 1 and _local(node[i - 2]) != "mo":
                    node.insert(i - 1, ElementTree.Element(f"{_NAMESPACE}mspace", width=_THIN))
    return ElementTree.tostring(tree, encoding="unicode")


def _local(node):
    return node.tag.removeprefix(_NAMESPACE)
