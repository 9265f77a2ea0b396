/* Where an IFC building model stands: its IFCSITE record, which mesh readers leave out.
 *
 * Reads the STEP file (ISO 10303-21) for IfcSite.RefLatitude, RefLongitude, RefElevation; the site's
 * ObjectPlacement, whose origin is the point that they locate; and TrueNorth of the model's
 * IfcGeometricRepresentationContext. Strict: what is there but not as IFC2x3/IFC4 define it is an error, not
 * a guess. IfcMapConversion is not read. */
#ifndef CORE_IFC_SITE_H
#define CORE_IFC_SITE_H

#include "core/err.h"

struct ifc_site {
    double lat_deg, lon_deg;
    double elevation_m; /* above the sea, by a datum the file does not name; NaN: not given */
    double origin_m[3]; /* the point that lies there, in the model's coordinates (z up) */
    double north_deg;   /* true north, clockwise from the model's y axis; 0 when not given */
    int has_north;
    int has_map; /* there is an IfcMapConversion, which may say more exactly where the model is */
};

/* Errors (SH_EINPUT) name file, record and line. */
int ifc_site_read(const char *path, struct ifc_site *site, struct sh_err *err);

#endif
