"""How the other ships move."""
