"""`paani claims`: the statements of the paper that PAANI follows, each with its proof."""
