"""What people type: one package per command."""
