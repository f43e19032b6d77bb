// The whole board: what setup and loop of the sketch call.
#ifndef BOARD_H
#define BOARD_H

void board_start();

// One pass of the main loop: everything once, the links between any two things.
void board_pass();

#endif
