"""System identification: numbers of a model, and effects that are stated, fitted to recordings by least squares."""
