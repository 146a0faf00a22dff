"""Batch studies of the seed paper's devices: maps of the crawler's stride, tables of the bi-fold, stored strides."""
