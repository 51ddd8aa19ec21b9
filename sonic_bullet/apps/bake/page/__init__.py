"""Page on which baked bodies are struck.

BakedModel -> variants (other materials) -> page_data (numbers) -> report.page.assembly -> .html
"""
