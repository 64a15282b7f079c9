from paani.cli import main

raise SystemExit(main())
