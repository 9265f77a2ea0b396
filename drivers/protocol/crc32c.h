/* SPDX-License-Identifier: MIT */
/* CRC-32C (Castagnoli, reflected polynomial 0x82f63b78, initial value and final inversion 0xffffffff; RFC
 * 3720 appendix B.4): by the CPU's instruction where there is one, else by table. The check value of
 * "123456789" is 0xe3069283. Pure; any thread. */
#ifndef DRIVERS_PROTOCOL_CRC32C_H
#define DRIVERS_PROTOCOL_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/* CRC of data after a part whose CRC is `crc` (0 at the start): crc32c(crc32c(0, a), b) is that of a then
 * b. */
uint32_t crc32c(uint32_t crc, const void *data, size_t len);

/* The three ways, for tests and the bench. Only where crc32c_has_hw() returns 1 may crc32c_hw be called, and likewise
 * crc32c_wide. */
int crc32c_has_hw(void);
uint32_t crc32c_hw(uint32_t crc, const void *data, size_t len);
int crc32c_has_wide(void);
uint32_t crc32c_wide(uint32_t crc, const void *data, size_t len);
uint32_t crc32c_table(uint32_t crc, const void *data, size_t len);

#endif
