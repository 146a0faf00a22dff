"""What a user keeps of a diagnosis: the patch of the model, and the page that shows what was found."""
