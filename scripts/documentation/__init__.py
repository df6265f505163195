"""The documentation's site: pages made from schemas, rules and docstrings, and MkDocs' hook.

`./run --docs mkdocs build --strict` makes `site/`; nothing that is made here is committed.
"""
