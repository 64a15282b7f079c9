"""`paani paper-report`: the paper's tables of results beside what stands here."""
