/* SPDX-License-Identifier: MIT */
/* Allocates memory for large arrays that are read at random. It is in huge pages where the system has
 * them, since page walks would cost as much as the data. It begins with a pair of cache lines, at a multiple
 * of 128. Released with free(). NULL when there is no memory. */
#ifndef CORE_HUGE_PAGES_H
#define CORE_HUGE_PAGES_H

#include <stddef.h>

void *huge_pages_alloc(size_t size);

#endif
