"""Pages that are struck and seen in a browser, offline: one HTML file each.

    BakedModel -> variants (other materials) -> page_data (numbers) -> assembly (template, scripts, policy) -> .html

Beside the Python of this folder stand the pages themselves: *.html.jinja, page.css, *.js as they are read, and in
vendor/ three.js, as vendor/README.md says.
"""
