"""Annotated pictures before training: public sets prepared, manifests, leaks between splits, bundles."""
