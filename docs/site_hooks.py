"""What turns docs/ into the site beside its Markdown, as hooks of MkDocs.

navigation      the headings and links of docs/README.md
API             docs/reference/api.md as mkdocstrings makes it of the same names
examples        a line that is a link to a script of examples/ or scenes/ -> code, picture, sound (docs/make_media.py);
                [Picture and sound of …] leaves the code out
bodies          a line that is a link to a mesh of assets/, [Strike the … of …] -> the page on which it is struck
links           to files of the project outside docs/ -> a page of the site that shows the file
anchors         as a forge makes them, so that one link serves both
"""

from __future__ import annotations

import inspect
import posixpath
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

REPO = Path(__file__).resolve().parents[1]
if str(REPO / "docs") not in sys.path:  # as here, all imports: MkDocs resets the path once hooks are loaded
    sys.path.insert(0, str(REPO / "docs"))
from make_media import MEDIA, SHOWN, STRUCK, struck_page  # noqa: E402
from make_reference import api_names  # noqa: E402

LINK = re.compile(r"(?<=\]\()([^)\s#:]+)(?=[#)])")
FENCED = re.compile(r"^```.*?^```", re.S | re.M)


def on_config(config: Any) -> Any:
    """Set the navigation and the anchors."""
    config.nav = read_navigation((REPO / "docs" / "README.md").read_text(encoding="utf-8"))
    config.mdx_configs["toc"]["slugify"] = make_anchor
    return config


def make_anchor(heading: str, separator: str) -> str:
    """Make a heading's anchor as a forge does."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", separator)


def read_navigation(index: str) -> list[Any]:
    """Return the navigation: a section for each heading of the index, a page for each link, in order."""
    navigation: list[Any] = [{"Home": ["README.md"]}]
    section = part = navigation
    for line in index.splitlines():
        if line.startswith("## "):
            section = part = []
            navigation.append({line[3:]: section})
        elif line.startswith("### "):
            part = []
            section.append({line[4:]: part})
        elif section is not navigation:
            part += [page for page in LINK.findall(line) if page.endswith(".md") and page not in part]
    return [
        {title: pages[0] if len(pages) == 1 and isinstance(pages[0], str) else pages}
        for entry in navigation
        for title, pages in entry.items()
    ]


def on_files(files: Any, config: Any) -> Any:
    """Add pictures, sounds and struck bodies, and a page for each file outside docs/ that a page links to."""
    from mkdocs.structure.files import File

    for path in sorted(MEDIA.rglob("*.*")):
        uri = f"media/{path.relative_to(MEDIA).as_posix()}"
        if path.suffix in {".png", ".flac", ".html"}:
            files.append(File.generated(config, uri, abs_src_path=str(path)))
    waiting = [f"docs/{file.src_uri}" for file in files.documentation_pages()]
    seen = set(waiting)
    while waiting:
        for target in project_links(waiting.pop()):
            if target in seen or target.startswith("docs/") or not (REPO / target).is_file():
                continue
            seen.add(target)
            waiting += [target] if target.endswith(".md") else []
            files.append(File.generated(config, site_name(target), content=source_page(target)))
    return files


def project_links(page: str) -> Iterator[str]:
    """Yield the files of the project that a page links to, as paths from the project's folder."""
    if not page.startswith("docs/source/"):
        for target in LINK.findall(FENCED.sub("", (REPO / page).read_text(encoding="utf-8"))):
            yield posixpath.normpath(posixpath.join(posixpath.dirname(page), target))


def site_name(path: str) -> str:
    """Return where the site shows a file of the project."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return f"source/{path}" if path.endswith(".md") else f"source/{path}.md"


def source_page(path: str) -> str:
    """Return a page that shows a file: Markdown as it is, all else as code."""
    text = (REPO / path).read_text(encoding="utf-8")
    body = text if path.endswith(".md") else f"# {path}\n\n````{Path(path).suffix[1:] or 'text'}\n{text}````\n"
    return f"---\nsearch:\n  exclude: true\n---\n{body}"


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Put in the API and the examples, and point links at pages of the site."""
    uri = page.file.src_uri
    if uri == "reference/api.md":
        return api_page()
    origin = uri.removeprefix("source/") if uri.startswith("source/") else f"docs/{uri}"

    def site_link(found: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(origin), found[1]))
        return posixpath.relpath(site_name(target), posixpath.dirname(uri) or ".")

    def example(found: re.Match[str]) -> str:
        return show_script(found[2], posixpath.dirname(uri), files, code=not found[1])

    def body(found: re.Match[str]) -> str:
        return show_body(struck_page(found[2], found[1]), posixpath.dirname(uri), files)

    return outside_fences(markdown, lambda text: LINK.sub(site_link, STRUCK.sub(body, SHOWN.sub(example, text))))


def outside_fences(markdown: str, change: Callable[[str], str]) -> str:
    """Change a page's text, not its blocks of code."""
    parts, end = [], 0
    for fence in FENCED.finditer(markdown):
        parts += [change(markdown[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, change(markdown[end:])])


def show_script(name: str, folder: str, files: Any, *, code: bool) -> str:
    """Show a script: its code, if asked for, its picture and its sound. What is missing is a warning."""
    from mkdocs.plugins import get_plugin_logger

    source = (REPO / f"{name}.py").read_text(encoding="utf-8")
    place = {}
    for end in ("png", "flac"):
        place[end] = posixpath.relpath(f"media/{name}.{end}", folder or ".")
        if files.get_file_from_path(f"media/{name}.{end}") is None:
            get_plugin_logger("site_hooks").warning(f"{name}.py has no .{end}: python docs/make_media.py {name}.py")
    return (
        (f'```python title="{name}.py"\n{source}```\n\n' if code else "")
        + f'<figure><img src="{place["png"]}" alt="what {name}.py draws" loading="lazy"></figure>\n\n'
        f'<audio controls preload="none" style="width: 100%" src="{place["flac"]}"></audio>\n'
    )


def show_body(page: str, folder: str, files: Any) -> str:
    """Show the page on which a body is struck, in a frame. A missing one is a warning."""
    from mkdocs.plugins import get_plugin_logger

    place = posixpath.relpath(f"media/{page}", folder or ".")
    if files.get_file_from_path(f"media/{page}") is None:
        get_plugin_logger("site_hooks").warning(f"{page} is missing: python docs/make_media.py")
    return (
        f'<iframe src="{place}" title="{Path(page).stem}" loading="lazy" '
        'style="width: 100%; height: 60rem; border: 0"></iframe>\n\n'
        f'<a href="{place}" target="_blank">In a window of its own</a>\n'
    )


def api_page() -> str:
    """Return the names of docs/reference/api.md as mkdocstrings' blocks, below the same headings."""
    parts = ["# API", "SI units throughout; `(k, 3)` is an array's shape."]
    for module, what, names in api_names():
        parts += [f"## {module}", what]
        for name, thing in names:
            defined = inspect.isclass(thing) or inspect.isfunction(thing)
            path = f"{thing.__module__}.{thing.__qualname__}" if defined else f"{module}.{name}"
            parts += [f'<a id="{make_anchor(name, "-")}"></a>', f"::: {path}"]
    return "\n\n".join(parts) + "\n"
