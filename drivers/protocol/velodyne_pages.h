/* SPDX-License-Identifier: MIT */
/* Documents of a VLP-16 over HTTP: JSON with the fields that known clients read. VELODYNE.md lists the fields. Values
 * of the head are read by native queries; fields that aren't modelled are constant. */
#ifndef DRIVERS_PROTOCOL_VELODYNE_PAGES_H
#define DRIVERS_PROTOCOL_VELODYNE_PAGES_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/protocol/protocol.h"

/* Writes the document of a path, as it is at device time t_ns, into dst, ended by a NUL. Returns its length; 0: the
 * path has no document. cap: the size of dst, 2048 for the longest document. */
size_t velodyne_page(const struct protocol_spec *spec, const char *path, int64_t t_ns, char *dst, size_t cap);
/* Whether a path has a document. */
int velodyne_has_page(const char *path);

#endif
