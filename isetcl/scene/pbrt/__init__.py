"""Scenes in the text format of PBRT, versions 3 and 4: reading and writing.

What the format means is stated in the file format pages of pbrt.org (v3 and v4) and in Pharr,
Jakob & Humphreys, Physically Based Rendering (3rd edition 2016, 4th edition 2023).
"""
