/* SPDX-License-Identifier: MIT */
/* Allocates memory for large arrays that are read at random. From 2 MiB on the memory is in huge pages where the system
 * has them, since page walks would cost as much as the data. The memory's address is a multiple of 128 bytes, a pair of
 * cache lines. Released with free(). NULL when there is no memory. */
#ifndef CORE_HUGE_PAGES_H
#define CORE_HUGE_PAGES_H

#include <stddef.h>

void *huge_pages_alloc(size_t size);

#endif
