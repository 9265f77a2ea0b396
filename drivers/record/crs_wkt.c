/* SPDX-License-Identifier: MIT */
#include "drivers/record/crs_wkt.h"

#include <stdio.h>

/* WGS 84 and EPSG's codes for its parts. */
#define DATUM                                                                                     \
    "DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563,AUTHORITY[\"EPSG\",\"7030\"]]," \
    "AUTHORITY[\"EPSG\",\"6326\"]],PRIMEM[\"Greenwich\",0,AUTHORITY[\"EPSG\",\"8901\"]],"
#define METRE "UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]]"
#define GEOGCS                 \
    "GEOGCS[\"WGS 84\"," DATUM \
    "UNIT[\"degree\",0.0174532925199433,AUTHORITY[\"EPSG\",\"9122\"]],AUTHORITY[\"EPSG\",\"4326\"]],"
/* Datum type 2002 is "ellipsoidal", 2005 a geoid's. */
static const char *height_of(int geoid)
{
    return geoid ? ",VERT_CS[\"EGM96 height\",VERT_DATUM[\"EGM96 geoid\",2005,AUTHORITY[\"EPSG\",\"5171\"]]," METRE
                   ",AXIS[\"Gravity-related height\",UP],AUTHORITY[\"EPSG\",\"5773\"]]]"
                 : ",VERT_CS[\"Ellipsoid (metre)\",VERT_DATUM[\"Ellipsoid\",2002]," METRE
                   ",AXIS[\"Ellipsoidal height\",UP]]]";
}

static const char *height_name(int geoid)
{
    return geoid ? "EGM96 height" : "Ellipsoid";
}

static int put_ecef(char *text)
{
    return snprintf(text, CRS_WKT_MAX,
                    "GEOCCS[\"WGS 84\"," DATUM METRE ",AXIS[\"Geocentric X\",OTHER],AXIS[\"Geocentric Y\",OTHER],"
                    "AXIS[\"Geocentric Z\",NORTH],AUTHORITY[\"EPSG\",\"4978\"]]");
}

static int put_ups(char *text, int north, int geoid)
{
    const char *name = north ? "WGS 84 / UPS North (E,N)" : "WGS 84 / UPS South (E,N)",
               *axis = north ? "SOUTH" : "NORTH";
    return snprintf(text, CRS_WKT_MAX,
                    "COMPD_CS[\"%s + %s\",PROJCS[\"%s\"," GEOGCS
                    "PROJECTION[\"Polar_Stereographic\"],PARAMETER[\"latitude_of_origin\",%d],"
                    "PARAMETER[\"central_meridian\",0],PARAMETER[\"scale_factor\",0.994],"
                    "PARAMETER[\"false_easting\",2000000],PARAMETER[\"false_northing\",2000000]," METRE
                    ",AXIS[\"Easting\",%s],AXIS[\"Northing\",%s],AUTHORITY[\"EPSG\",\"%d\"]]%s",
                    name, height_name(geoid), name, north ? 90 : -90, axis, axis, north ? 5041 : 5042,
                    height_of(geoid));
}

static int put_utm(char *text, int zone, int north, int geoid)
{
    char name[32];
    snprintf(name, sizeof name, "WGS 84 / UTM zone %d%c", zone, north ? 'N' : 'S');
    return snprintf(text, CRS_WKT_MAX,
                    "COMPD_CS[\"%s + %s\",PROJCS[\"%s\"," GEOGCS
                    "PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],"
                    "PARAMETER[\"central_meridian\",%d],PARAMETER[\"scale_factor\",0.9996],"
                    "PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",%d]," METRE
                    ",AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"%d\"]]%s",
                    name, height_name(geoid), name, 6 * zone - 183, north ? 0 : 10000000,
                    (north ? 32600 : 32700) + zone, height_of(geoid));
}

/* x is longitude. */
static int put_geodetic(char *text, int geoid)
{
    return snprintf(text, CRS_WKT_MAX,
                    "COMPD_CS[\"WGS 84 + %s\",GEOGCS[\"WGS 84\"," DATUM
                    "UNIT[\"degree\",0.0174532925199433,AUTHORITY[\"EPSG\",\"9122\"]],AXIS[\"Longitude\",EAST],"
                    "AXIS[\"Latitude\",NORTH]]%s",
                    height_name(geoid), height_of(geoid));
}

size_t crs_wkt(int epsg, int geoid, char text[CRS_WKT_MAX])
{
    int n = 0, hundred = epsg / 100, zone = epsg % 100;
    text[0] = 0;
    if (epsg == 4978)
        n = put_ecef(text);
    else if (epsg == 32661 || epsg == 32761)
        n = put_ups(text, epsg == 32661, geoid);
    else if (epsg == 4979)
        n = put_geodetic(text, geoid);
    else if ((hundred == 326 || hundred == 327) && zone >= 1 && zone <= 60)
        n = put_utm(text, zone, hundred == 326, geoid);
    return (size_t)n;
}
