"""A Modbus TCP server of libmodbus for several clients, as its own example makes one: 100 of each kind.

Arguments: the port, and how many clients may wait to be accepted. Nothing of the protocol is done here: libmodbus receives
and replies."""

import ctypes
import ctypes.util
import os
import select
import sys

LONGEST = 260
SIZE = 100

library = ctypes.util.find_library("modbus") or sys.exit("libmodbus is not installed")
modbus = ctypes.CDLL(library, use_errno=True)
modbus.modbus_new_tcp.restype = ctypes.c_void_p
modbus.modbus_mapping_new.restype = ctypes.c_void_p
context = ctypes.c_void_p(modbus.modbus_new_tcp(b"127.0.0.1", int(sys.argv[1])))
mapping = ctypes.c_void_p(modbus.modbus_mapping_new(SIZE, SIZE, SIZE, SIZE))
listening = modbus.modbus_tcp_listen(context, int(sys.argv[2]))
if listening < 0:
    sys.exit("cannot listen: " + os.strerror(ctypes.get_errno()))
version = (ctypes.c_uint.in_dll(modbus, "libmodbus_version_" + part).value for part in ("major", "minor", "micro"))
print("libmodbus", ".".join(map(str, version)), flush=True)
query = (ctypes.c_uint8 * LONGEST)()
clients = set()
while True:
    ready, _, _ = select.select([listening, *clients], [], [])
    for descriptor in ready:
        if descriptor == listening:
            accepted = ctypes.c_int(listening)
            client = modbus.modbus_tcp_accept(context, ctypes.byref(accepted))
            if client >= 0:
                clients.add(client)
            continue
        modbus.modbus_set_socket(context, descriptor)
        length = modbus.modbus_receive(context, query)
        if length > 0:
            modbus.modbus_reply(context, query, length, mapping)
        elif length < 0:
            clients.discard(descriptor)
            os.close(descriptor)
