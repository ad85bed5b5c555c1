from .child_session import ChildSession as ChildSession
from .commands import Controls as Controls
from .recorder import reserve_recording as reserve_recording
from .server import LiveServer as LiveServer
from .session import Session as Session
from .viewers import Address as Address
