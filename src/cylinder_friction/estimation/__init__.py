"""From logger files to friction, without a project around them."""
