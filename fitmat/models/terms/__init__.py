"""Terms of which lobes are made: Fresnel reflectance, distributions of normals, masking.

They are no BRDFs by themselves.
"""
