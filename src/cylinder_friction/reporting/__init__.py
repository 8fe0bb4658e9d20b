"""What people look at: pages, figures and tables. It draws and computes nothing."""
