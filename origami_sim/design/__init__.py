"""What a designer states of a sheet, and the model that it makes: layers, creases, masses, ground, touching panels."""
