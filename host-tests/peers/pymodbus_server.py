"""A Modbus TCP server of pymodbus, as its documentation makes one: 100 of each kind. Argument: the port."""

import sys

import pymodbus
from pymodbus import ModbusDeviceIdentification
from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
from pymodbus.server import StartTcpServer

SIZE = 100


def block():
    # this data block counts from 1
    return ModbusSequentialDataBlock(1, [0] * SIZE)


device = ModbusDeviceContext(di=block(), co=block(), hr=block(), ir=block())
identity = ModbusDeviceIdentification(info_name={"VendorName": "a", "ProductCode": "b", "MajorMinorRevision": "1"})
print("pymodbus", pymodbus.__version__, flush=True)
StartTcpServer(
    context=ModbusServerContext(devices=device, single=True),
    identity=identity,
    address=("127.0.0.1", int(sys.argv[1])),
)
