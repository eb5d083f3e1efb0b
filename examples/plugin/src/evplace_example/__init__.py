"""Parts of evplace in a package of their own."""
