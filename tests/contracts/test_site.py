"""The site of docs/: each page has one place in its navigation, what pages show is there, and the build is strict."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

REPO = Path(__file__).resolve().parents[2]
DOCS = REPO / "docs"


@pytest.fixture(scope="module")
def hooks() -> ModuleType:
    """The hooks of the build; they need MkDocs only while it builds."""
    spec = importlib.util.spec_from_file_location("site_hooks", DOCS / "site_hooks.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def leaves(navigation: Any) -> Iterator[str]:
    """The pages of a navigation, in order."""
    if isinstance(navigation, str):
        yield navigation
    else:
        for part in navigation.values() if isinstance(navigation, dict) else navigation:
            yield from leaves(part)


def test_every_page_has_one_place_in_the_navigation(hooks: ModuleType) -> None:
    found = list(leaves(hooks.read_navigation((DOCS / "README.md").read_text(encoding="utf-8"))))
    assert sorted(found) == sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))
    assert found[0] == "README.md" and len(found) > 60


def test_a_navigation_has_the_headings_of_its_index(hooks: ModuleType) -> None:
    index = "# A\n\n[x](x.md)\n\n## One\n\n- [p](p.md)\n\n## Two\n\n### In\n\n- [q](q.md): [r](r.md#s)\n- [q](q.md)\n"
    assert hooks.read_navigation(index) == [{"Home": "README.md"}, {"One": "p.md"}, {"Two": [{"In": ["q.md", "r.md"]}]}]


def test_links_out_of_the_documentation_are_pages_of_the_site(hooks: ModuleType) -> None:
    out = [
        target
        for page in DOCS.rglob("*.md")
        for target in hooks.project_links(page.relative_to(REPO).as_posix())
        if not target.startswith("docs/")
    ]
    assert len(out) > 10 and all((REPO / target).is_file() for target in out), out
    assert hooks.site_name("tests/a.py") == "source/tests/a.py.md"
    assert hooks.site_name("docs/start/install.md") == "start/install.md"


def test_code_is_left_as_it_is(hooks: ModuleType) -> None:
    page = "a\n```text\na\n```\na\n"
    assert hooks.outside_fences(page, lambda text: text.replace("a", "b")) == "b\n```text\na\n```\nb\n"


def test_the_build_is_strict() -> None:
    makefile = (REPO / "Makefile").read_text(encoding="utf-8")
    assert "mkdocs build --strict" in makefile[makefile.index("\ndocs:") : makefile.index("\nclean:")]
    settings = (REPO / "mkdocs.yml").read_text(encoding="utf-8")
    for check in ("omitted_files", "absolute_links", "unrecognized_links", "anchors"):
        assert f"  {check}: warn\n" in settings


@pytest.mark.slow
@pytest.mark.parametrize(("more", "passes"), [("", True), ("\n[nowhere](start/nowhere.md)\n", False)])
def test_the_site_is_built_unless_a_link_is_dead(tmp_path: Path, more: str, passes: bool) -> None:
    pytest.importorskip("mkdocs")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config
    from mkdocs.exceptions import Abort

    docs, media = tmp_path / "docs", tmp_path / "media"
    shutil.copytree(DOCS, docs)
    (docs / "glossary.md").write_text((DOCS / "glossary.md").read_text(encoding="utf-8") + more, encoding="utf-8")
    config = load_config(str(REPO / "mkdocs.yml"), strict=True, docs_dir=str(docs), site_dir=str(tmp_path / "site"))
    own = config.hooks["docs/site_hooks.py"]
    own.MEDIA = media
    for _, name in own.SHOWN.findall((DOCS / "gallery.md").read_text(encoding="utf-8")):
        for end in ("png", "flac"):
            place = media / f"{name}.{end}"
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(b"made by docs/make_media.py")
    for material, mesh in own.STRUCK.findall((DOCS / "gallery.md").read_text(encoding="utf-8")):
        place = media / own.struck_page(mesh, material)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text("<p>made by docs/make_media.py</p>")
    config.plugins.on_startup(command="build", dirty=False)
    if passes:
        build(config)
        page = (tmp_path / "site" / "gallery.html").read_text(encoding="utf-8")
        assert page.count("<iframe ") == 2 and (tmp_path / "site" / "media" / "struck" / "bowl-steel.html").is_file()
        assert page.count("<audio ") == page.count("<figure>") == 13
        assert 'id="attach"' in (tmp_path / "site" / "reference" / "api.html").read_text(encoding="utf-8")
    else:
        with pytest.raises(Abort, match="1 warnings in strict mode"):
            build(config)
