"""What may be wrong with a model: numbers with priors, and effects of the catalogue that it may lack, and where."""
