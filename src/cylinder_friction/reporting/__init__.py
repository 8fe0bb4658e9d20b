"""What people look at: figures, tables, the comparison report and the inspection page."""
