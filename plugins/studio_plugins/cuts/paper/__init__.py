"""The method of Iwasaki, Dobashi and Nishita, "Interactive Lighting and Material Design System for Cyber
Worlds" (2010), section V: visibility as the product of self-visibility cuts and visibility cut fields.

`height_cuts` and `codes` are V.A.2 (figure 5), `operations` V.A.3 (figure 6), `svc` and `vcf` V.A.1
(figure 4), `path` equations (3) and (4) with V.A.4 and V.B, `table` the figures of section VI.
"""
