"""`paani certs`: a small certificate authority for the processes of one boat."""
