/* SPDX-License-Identifier: MIT */
/* A CRS as well-known text 1 (OGC 01-009), as LAS 1.4 and E57 want it. In: an EPSG
 * code, and which heights. Out: the text. */
#ifndef DRIVERS_RECORD_CRS_WKT_H
#define DRIVERS_RECORD_CRS_WKT_H

#include <stddef.h>

enum { CRS_WKT_MAX = 1536 };

/* Writes the text of one of the CRSs that a stream can be in, all on WGS 84: 4978 (ECEF), 326zz and 327zz (UTM),
 * 32661 and 32761 (UPS), 4979 (geodetic; longitude first). All but ECEF come with the vertical CRS of their
 * heights: above the ellipsoid or, where geoid is 1, above EGM96. UPS is written as 5041 and 5042, the same
 * projections with the easting first, which is the order of x and y here. Returns the length. The length is 0, and the
 * text empty, for the scene frame and for other codes. */
size_t crs_wkt(int epsg, int geoid, char text[CRS_WKT_MAX]);

#endif
