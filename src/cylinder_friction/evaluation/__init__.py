"""Everything computed about results: errors, comparison, residuals, inspection."""
