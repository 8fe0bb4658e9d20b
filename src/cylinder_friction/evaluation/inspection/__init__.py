"""What every check and view finds in logger files before anything is trained on them."""
