from .contents import McapFile as McapFile
from .records import DamageError as DamageError
from .records import UnsupportedError as UnsupportedError
from .rows import MAX_DEFINITION as MAX_DEFINITION
from .rows import Column as Column
from .rows import EncodedRows as EncodedRows
