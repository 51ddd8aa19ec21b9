"""Pages that are struck and seen in a browser, offline: one HTML file each.

    numbers of a body or a scene -> assembly (template, scripts, policy) -> .html

Beside the Python of this folder stand the pages themselves: *.html.jinja, page.css, *.js as they are read, and in
vendor/ three.js, as vendor/README.md says.
"""
