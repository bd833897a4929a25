"""Large: more rows than fit in memory, passed over block by block.

It reads the same formats as the reader and fits nothing.
"""
