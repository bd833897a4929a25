"""MaterialX: the document, what its nodes compute as models, and its own generated shader.

It writes no texture.
"""
