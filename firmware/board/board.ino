// Board between the host and the wrist's servos: packet-aware bridge and digital lines. See README.md and PROTOCOL.md.
#include "board.h"

void setup() { board_start(); }

void loop() { board_pass(); }
