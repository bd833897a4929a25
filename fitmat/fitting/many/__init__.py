"""Many: small fits of one model to many surfaces seen from the same directions, as one compiled program.

They read no file and draw nothing.
"""
