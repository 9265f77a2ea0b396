/* SPDX-License-Identifier: MIT */
/* Where an IFC building model stands: its IFCMAPCONVERSION and IFCSITE records, which mesh readers leave out.
 *
 * The module reads the following from the STEP file (ISO 10303-21): IfcSite.RefLatitude, RefLongitude, RefElevation;
 * the site's ObjectPlacement, whose origin is the point that these three locate; TrueNorth of the model's
 * IfcGeometricRepresentationContext; and IfcMapConversion, which gives the model's origin coordinates in an
 * IfcProjectedCRS. A record that is there, but not as IFC2x3/IFC4 define it, is an error. Nothing is guessed.
 *
 * IfcMapConversion.Scale is map units per unit of the model; IfcMapConversionScaled has a factor for each axis as well,
 * and Scale times factor counts. The model is never scaled: factors have to agree within 1 %. Several map conversions
 * have to say the same. Where IfcProjectedCRS has no MapUnit, the map's unit is found from the model's unit divided by
 * Scale. The unit of the system's axes, which PROJ knows, is taken if it is within 1 % of that quotient. Otherwise it
 * is the one that is nearest to the quotient and within 1 %: metre, the model's own unit, foot or US survey foot. If
 * none is, this is an error. */
#ifndef CORE_IFC_SITE_H
#define CORE_IFC_SITE_H

#include "core/err.h"

struct ifc_site {
    double lat_deg, lon_deg;
    double elevation_m; /* above the sea, by a datum the file does not name; NaN: not given */
    double origin_m[3]; /* the point that lies there, in the model's coordinates (z up) */
    double north_deg;   /* true north, clockwise from the model's y axis; 0 when not given */
    int has_place;      /* latitude and longitude are known; else there is a map */
    int has_map;
    struct ifc_map {
        char crs[128]; /* the system's name, UTF-8: "EPSG:2056" */
        double easting_m, northing_m,
            height_m;      /* of the model's origin; height by the system's own datum, NaN: not given */
        double x_axis_rad; /* of the model's x axis, counter-clockwise from grid east */
    } map;
};

/* Errors (SH_EINPUT) name file, record and line. */
int ifc_site_read(const char *path, struct ifc_site *site, struct sh_err *err);

#endif
