"""Inverse feedforward from displacement to temperature and power, with preview of reversals."""
