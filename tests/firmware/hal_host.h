// The registers of the board, played on a PC: two UARTs with byte times, pins, a clock that runs while it is looked at.
#ifndef HAL_HOST_H
#define HAL_HOST_H

#include <stdint.h>

const uint8_t TICKS_PER_US = 2;
const uint8_t HAL_KNOT = 1 << 0;
const uint8_t HAL_MOVING = 1 << 1;
const uint8_t HAL_STOP = 1 << 2;
const uint8_t HAL_RECEIVED = 0x80;
const uint8_t HAL_SENT = 0x40;
const uint8_t HAL_READY = 0x20;
const uint8_t HAL_OVERRUN = 0x08;

void hal_start();
[[noreturn]] void hal_reset();
uint16_t hal_resets();
uint16_t hal_reset_cause();
uint16_t hal_stack_free();
void hal_alive();
uint16_t hal_ticks();
uint8_t hal_host_status();
uint8_t hal_host_read();
void hal_host_write(uint8_t byte);
uint8_t hal_bus_status();
uint8_t hal_bus_read();
void hal_bus_write(uint8_t byte);
void hal_bus_drive();
void hal_bus_release();
uint8_t hal_lines();
void hal_wrist_ok(bool on);
bool hal_captured();
uint16_t hal_capture();

#endif
