"""Copy files of the package into the build folder: copy_package.py SOURCE_FOLDER STAMP FILE ..

The files keep their paths below the source folder, and are copied to the folder of STAMP, which is
then touched.
"""

import shutil
import sys
from pathlib import Path

source, stamp = Path(sys.argv[1]), Path(sys.argv[2])
for file in sys.argv[3:]:
    copy = stamp.parent / Path(file).resolve().relative_to(source)
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, copy)
stamp.touch()
