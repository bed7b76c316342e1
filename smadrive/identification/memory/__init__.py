"""Identification of models with memory: masses of a Preisach plane, rules and plane in parallel, held-out loops."""
