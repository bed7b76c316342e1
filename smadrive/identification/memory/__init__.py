"""Identification of models with memory: the masses of a Preisach plane, its share beside the rules, held-out loops."""
