"""A control process over NMEA for measurements: answers every $PUSVT on port 1 with $PUSVA to port 2."""

import socket
import sys

from hil_demand import demand

wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
wire.bind(("127.0.0.1", int(sys.argv[1])))
while True:
    for line in wire.recv(65536).decode().splitlines():
        if line.startswith("$PUSVT,"):
            step = int(line.split(",")[1])
            rpm_s, rpm_p, rpm_b, nozzle_s, nozzle_p, bucket_s, bucket_p = (
                f"{100 * value:.2f}" for value in demand(step)
            )
            body = f"PUSVA,{step},{rpm_p},{nozzle_p},{bucket_p},{rpm_s},{nozzle_s},{bucket_s},{rpm_b}"
            total = 0
            for byte in body.encode():
                total ^= byte
            wire.sendto(f"${body}*{total:02X}\r\n".encode(), ("127.0.0.1", int(sys.argv[2])))
