// What the board is made of: the registers of the ATmega2560, or in the tests on a PC what stands in for them.
#ifndef HAL_H
#define HAL_H

#ifdef __AVR__
#include "hal_avr.h"
#else
#include "hal_host.h"
#endif

#endif
