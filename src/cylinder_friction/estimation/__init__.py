"""From logger files to friction and friction models, without a project around them."""
