"""Displacement references: samples, shapes, cycles."""
