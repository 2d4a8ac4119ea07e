"""`gather`: light between surfaces by kept rays, two tiers of them.

All vertices have a few rays; over these light goes from surface to surface (`studio_core.transport.bounces`).
The vertices that the picture shows have many, which collect what all others send once at the end (`final`),
and where they are glossy further ones by their own lobes (`lobes`). While somebody moves something, few rays
and a filter within each object (`smooth`); at rest more of both, tier by tier (`tiers`). `stages` puts all in
order, `method` says what can be asked for.
"""
