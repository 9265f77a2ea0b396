/* SPDX-License-Identifier: MIT */
/* Documents of a VLP-16 over HTTP: JSON with the fields that known clients read. VELODYNE.md lists them. Values of
 * the head are read by native queries; fields that aren't modelled are constant. */
#ifndef DRIVERS_PROTOCOL_VELODYNE_PAGES_H
#define DRIVERS_PROTOCOL_VELODYNE_PAGES_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/protocol/protocol.h"

/* The document of a path, at device time t_ns, ended by a NUL: its length; or 0 where there is none. cap
 * 2048. */
size_t velodyne_page(const struct protocol_spec *spec, const char *path, int64_t t_ns, char *dst, size_t cap);
/* Whether a path has one. */
int velodyne_has_page(const char *path);

#endif
