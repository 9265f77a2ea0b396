/* SPDX-License-Identifier: MIT */
/* From a configuration to the places of its stations. Run from the top of the source tree. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/locate.h"
#include "firmware_sim/app/check_places.h"
#include "firmware_sim/config/load.h"

static struct site *site;

/* Makes a floor of 60 x 60 m about (x, y), at z. */
static void write_floor(double x, double y, double z)
{
    char text[512];
    snprintf(text, sizeof text, "v %.3f %.3f %.3f\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nf 1 2 3 4\n",
             x - 30, y - 30, z, x + 30, y - 30, z, x + 30, y + 30, z, x - 30, y + 30, z);
    write_in("floor.obj", text);
}

static int load(const char *anchor, const char *stations, const char *output)
{
    char text[2048];
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i}\nscene:\n  tolerance_m: 1e-6\n"
             "  meshes: [{file: floor.obj, up: z, scale: 1}]\n%s\nstations:\n%s\noutput: {crs: %s, layout: geo}\n",
             anchor, stations, output);
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    clear_warned();
    memset(&err, 0, sizeof err);
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, &report, &site, &err) : rc;
}

static void ok(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

static void assert_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.15g instead of %.15g, off by %.3g", got, want, got - want);
}

static void assert_position(uint32_t i, double x, double y, double z, double tolerance)
{
    const double *p = site->station[i].at.position_m;
    assert_near(p[0], x, tolerance);
    assert_near(p[1], y, tolerance);
    assert_near(p[2], z, tolerance);
}

/* A corner of the scene in the CRS is the same from each station. */
static void assert_corner_agrees(const double corner[3])
{
    double first[3];
    for (uint32_t i = 0; i < site->n_stations; i++) {
        double d[3], anchor[3];
        for (int k = 0; k < 3; k++)
            d[k] = corner[k] - site->station[i].at.position_m[k];
        georef_anchor(site->station[i].georef, anchor);
        georef_forward(site->station[i].georef, 1, (struct vec3_in){&d[0], &d[1], &d[2]},
                       (struct vec3_out){&d[0], &d[1], &d[2]});
        for (int k = 0; k < 3; k++) {
            d[k] += anchor[k];
            if (i == 0) first[k] = d[k];
            assert_near(d[k], first[k], 1e-7);
        }
        assert_int_equal(georef_epsg(site->station[i].georef), georef_epsg(site->station[0].georef));
    }
}

/* All forms of one place give one place. The UTM and ECEF figures come from the place itself, and 4 decimals of metres
 * in the text leave 5e-5. */
static void each_form_leads_to_the_same_place(void **state)
{
    (void)state;
    static const char anchor[] = "  anchor: {source: explicit, origin_m: [5, 6, 7], lat_deg: 52.5, lon_deg: 13.4, "
                                 "height_m: 100, north_deg: 20}";
    static const char *const crs[] = {"ecef", "utm"};
    struct locate_grid utm;
    double p[3];
    char stations[512];
    write_floor(0, 0, 0);
    ok(load(anchor, "  - {position_m: [15, -20, 2]}", "local"));
    const struct georef_place at = site->station[0].at.place;
    ok(locate_in_grid(&at, 0, &utm, &err));
    georef_geodetic_to_ecef(&at, p);
    snprintf(stations, sizeof stations,
             "  - {position_m: [15, -20, 2]}\n  - {lat_deg: %.10f, lon_deg: %.10f, height_m: %.4f}\n"
             "  - {utm_zone: %d, hemisphere: north, easting_m: %.4f, northing_m: %.4f, height_m: %.4f}\n"
             "  - {ecef_m: [%.4f, %.4f, %.4f]}\n",
             at.lat_deg, at.lon_deg, at.height_m, utm.zone, utm.easting_m, utm.northing_m, at.height_m, p[0], p[1],
             p[2]);
    for (int c = 0; c < 2; c++) {
        ok(load(anchor, stations, crs[c]));
        for (uint32_t i = 0; i < 4; i++)
            assert_position(i, 15, -20, 2, 1e-4);
        assert_corner_agrees((const double[3]){30, 30, 0});
    }
}

/* All stations of a scene are in one grid, also on both sides of the equator or of the edge of UPS. */
static void the_equator_and_the_edge_of_ups_do_not_part_stations(void **state)
{
    (void)state;
    static const char both[] = "  - {position_m: [0, 20, 2]}\n  - {position_m: [0, -20, 2]}";
    write_floor(0, 0, 0);
    ok(load("  anchor: {source: explicit, lat_deg: 0, lon_deg: 15, height_m: 0}", both, "utm"));
    assert_corner_agrees((const double[3]){30, 30, 0});
    ok(load("  anchor: {source: explicit, lat_deg: -0.0000001, lon_deg: 15, height_m: 0}", both, "utm"));
    assert_corner_agrees((const double[3]){30, 30, 0});
    assert_int_equal(georef_epsg(site->station[0].georef), 32733);
    ok(load("  anchor: {source: explicit, lat_deg: 84.00005, lon_deg: 15, height_m: 0}", both, "utm"));
    assert_corner_agrees((const double[3]){30, 30, 0});
    assert_int_equal(georef_epsg(site->station[1].georef), 32661);
    assert_string_equal(warned, "");
    /* The station is given in the southern grid, on the equator. */
    double anchor[3];
    ok(load("",
            "  - {position_m: [0, 0, 2], utm_zone: 33, hemisphere: south, easting_m: 500000, northing_m: 10000000, "
            "height_m: 0}",
            "utm"));
    assert_int_equal(georef_epsg(site->station[0].georef), 32733);
    georef_anchor(site->station[0].georef, anchor);
    assert_near(anchor[1], 1e7, 1e-6);
}

/* Without an anchor the place on the Earth is that of position_m as given: both rise with the instrument. */
static void instrument_height_moves_the_height_on_the_earth(void **state)
{
    (void)state;
    write_floor(0, 0, 0);
    ok(load("", "  - {position_m: [0, 0, 1.5], instrument_height_m: 2, lat_deg: 50, lon_deg: 10, height_m: 80}",
            "utm"));
    assert_position(0, 0, 0, 2, 1e-9);
    assert_near(site->station[0].at.place.height_m, 80.5, 1e-9);
    ok(load("", "  - {position_m: [0, 0, 1.5], instrument_height_m: 2}", "local"));
    assert_false(site->station[0].at.on_earth);
    assert_true(site->station[0].at.place.height_m == 0); /* placement.h: a place that is not known is 0 */
}

/* Two stations across a zone's border (12 deg E, 1 m and 40 m away) share the anchor's zone. */
static void a_zone_border_does_not_part_stations(void **state)
{
    (void)state;
    write_floor(0, 0, 0);
    ok(load("  anchor: {source: explicit, lat_deg: 50, lon_deg: 11.9999999, height_m: 0}",
            "  - {position_m: [-20, 0, 2]}\n  - {position_m: [20, 0, 2]}", "utm"));
    assert_corner_agrees((const double[3]){30, 30, 0});
    assert_string_equal(warned, "");
    /* Without an anchor they don't, and there is a warning. */
    ok(load("",
            "  - {position_m: [-20, 0, 2], lat_deg: 50, lon_deg: 11.9997, height_m: 0}\n"
            "  - {position_m: [20, 0, 2], lat_deg: 50, lon_deg: 12.0003, height_m: 0}",
            "utm"));
    assert_non_null(strstr(warned, "EPSG 32633, station station-1 in 32632"));
}

/* A mesh in UTM: stations given in UTM have the scene's coordinates to the last bit, those by lat and lon nearly. */
static void a_mesh_in_utm(void **state)
{
    (void)state;
    static const char anchor[] = "  anchor: {source: utm, utm_zone: 33, hemisphere: north}";
    const double corner[3] = {391467, 5819741, 111};
    double anchor_m[3];
    write_floor(391437, 5819711, 111);
    ok(load(anchor,
            "  - {easting_m: 391437.1, northing_m: 5819711.2, height_m: 112.3, heading_deg: 30}\n"
            "  - {lat_deg: 52.516686437, lon_deg: 13.400081019, height_m: 111.6, instrument_height_m: 1.5}\n",
            "utm"));
    const double exact[3] = {391437.1, 5819711.2, 112.3};
    assert_memory_equal(site->station[0].at.position_m, exact, sizeof exact);
    georef_anchor(site->station[0].georef, anchor_m);
    assert_memory_equal(anchor_m, exact, sizeof exact);
    assert_near(site->station[1].at.position_m[2], 112.5, 1e-9); /* floor at 111 */
    assert_near(site->station[1].at.place.height_m, 112.5, 1e-9);
    assert_corner_agrees(corner);
    ok(load(anchor,
            "  - {easting_m: 391437.1, northing_m: 5819711.2, height_m: 112.3}\n"
            "  - {position_m: [391450, 5819700, 113]}",
            "ecef"));
    assert_corner_agrees(corner);
}

/* A place 1 km south of the equator lies at 9,999 km in the southern grid, and at -1 km in the northern grid of the
 * scene. 500 m east of the zone's middle meridian both are right to the nanometre. */
static void a_place_in_the_other_hemisphere_s_grid(void **state)
{
    (void)state;
    write_floor(500500, -1000, 0);
    ok(load("  anchor: {source: utm, utm_zone: 33, hemisphere: north}",
            "  - {utm_zone: 33, hemisphere: south, easting_m: 500500, northing_m: 9999000, height_m: 2}", "utm"));
    assert_position(0, 500500, -1000, 2, 1e-6);
}

/* In a scene in ECEF the floor is down the plumb line, and the head upright; at (a, 0, 0) down is -X. */
static void a_mesh_in_ecef(void **state)
{
    (void)state;
    write_in("floor.obj", "v 6378140 -9 -9\nv 6378140 9 -9\nv 6378140 9 9\nv 6378140 -9 9\nf 1 2 3 4\n");
    ok(load("  anchor: {source: ecef}", "  - {ecef_m: [6378145, 0, 0], instrument_height_m: 2, heading_deg: 90}",
            "utm"));
    assert_position(0, 6378142, 0, 0, 2e-9);
    const double *r = site->station[0].at.rotation;
    /* forward (second column): heading 90 is east, Y; up is X; right is south, -Z */
    const double want[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
    for (int i = 0; i < 9; i++)
        assert_near(r[i], want[i], 1e-14);
}

static void an_instrument_height_counts_from_the_floor(void **state)
{
    (void)state;
    write_floor(0, 0, -0.25);
    ok(load("",
            "  - {position_m: [3, 4, 1], instrument_height_m: 1.5}\n  - {position_m: [3, 4, 1]}\n"
            "  - {position_m: [3, 4, -0.25], instrument_height_m: 1.5, roll_deg: 30}",
            "local"));
    assert_position(0, 3, 4, 1.25, 1e-14);
    assert_position(1, 3, 4, 1, 0);
    assert_position(2, 3, 4, 1.25, 1e-14); /* from the floor itself */
    assert_int_equal(load("", "  - {name: gate, position_m: [3, 4, -1], instrument_height_m: 1.5}", "local"),
                     SH_EINPUT);
    assert_non_null(
        strstr(err.text, "stations[0] (gate): instrument_height_m, but no surface of the scene lies below"));
    assert_null(strchr(err.text, '\n'));
    ok(load("", "  - {position_m: [3, 4, 1], instrument_height_m: 1.5, pitch_deg: 10}", "local"));
    assert_position(0, 3, 4, 1.25, 1e-14);
}

static void what_has_no_place_is_refused(void **state)
{
    (void)state;
    write_floor(0, 0, 0);
    static const struct {
        const char *anchor, *stations, *part;
    } bad[] = {
        {"  anchor: {source: utm, utm_zone: 33, hemisphere: north}", "  - {lat_deg: 52, lon_deg: 120, height_m: 0}",
         "UTM zone 33 does not reach latitude 52, longitude 120"},
        {"  anchor: {source: utm, utm_zone: 33, hemisphere: north}",
         "  - {easting_m: 2e6, northing_m: 5e6, height_m: 0}", "is not in UTM zone 33N"},
        {"  anchor: {source: ecef}", "  - {position_m: [1, 2, 3]}", "not near the Earth's surface"},
        {"  anchor: {source: ifc}", "  - {position_m: [1, 2, 3]}", "no mesh is an .ifc file"},
        {"", "  - {position_m: [0, 0, 1], ecef_m: [1, 2, 3]}", "not near the Earth's surface"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        int code = load(bad[i].anchor, bad[i].stations, "local");
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d \"%s\" without \"%s\"", i, code, err.text, bad[i].part);
    }
    const char *apart = "  - {lat_deg: 89.5, lon_deg: 0, height_m: 0}\n  - {lat_deg: 60, lon_deg: 0, height_m: 0}";
    assert_int_equal(load("  anchor: {source: explicit, lat_deg: 89.5, lon_deg: 0, height_m: 0}", apart, "utm"),
                     SH_EINPUT);
    assert_non_null(strstr(err.text, ": station station-2: georef: UPS does not reach latitude 60"));
}

/* Reads the printed azimuth of the y axis: from true north, and from grid north. */
static void read_azimuths(double *azimuth_deg, double *from_grid_deg)
{
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    check_print_station(site, 0, out);
    fclose(out);
    const char *at = strstr(text, "azimuth ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "azimuth %lf deg from true north, %lf", azimuth_deg, from_grid_deg), 2);
    free(text);
}

/* Headings count from the scene's y axis; convergence separates true from grid north. On a sphere tan(convergence) =
 * tan(dlon) sin(lat); the ellipsoid adds less than 1e-4 of it. */
static void headings_and_convergence(void **state)
{
    (void)state;
    double azimuth_deg, from_grid_deg, convergence_deg = atan(tan(3 * M_PI / 180) * sin(50 * M_PI / 180)) * 180 / M_PI;
    write_floor(0, 0, 0);
    ok(load("  anchor: {source: explicit, lat_deg: 50, lon_deg: 18, height_m: 0, north_deg: 20}",
            "  - {position_m: [0, 0, 2], heading_deg: 50}", "local"));
    read_azimuths(&azimuth_deg, &from_grid_deg); /* 18 E: the first of zone 34, whose meridian is 21 E, 3 deg away */
    assert_near(azimuth_deg, 30, 1e-6);
    assert_near(from_grid_deg, 30 + convergence_deg, 3e-4);
    struct locate_grid utm;
    char text[256];
    ok(locate_in_grid(&(struct georef_place){50, 18, 0}, 33, &utm, &err)); /* the other side: 3 deg east of 15 E */
    write_floor(utm.easting_m, utm.northing_m, 0);
    snprintf(text, sizeof text, "  - {easting_m: %.4f, northing_m: %.4f, height_m: 2, heading_deg: 50}", utm.easting_m,
             utm.northing_m);
    ok(load("  anchor: {source: utm, utm_zone: 33, hemisphere: north}", text, "utm"));
    read_azimuths(&azimuth_deg, &from_grid_deg);
    assert_near(from_grid_deg, 50, 1e-6);
    assert_near(azimuth_deg, 50 + convergence_deg, 3e-4);
}

/* At the edge of what UTM can reach (easting 0), a range's error, taken from points 50 m to either side, is left out. A
 * scene near 0 is hardly in UTM, which is said once. */
static void a_place_at_the_edge_of_utm(void **state)
{
    (void)state;
    static const char anchor[] = "  anchor: {source: utm, utm_zone: 33, hemisphere: north}";
    static const struct {
        double easting_m;
        int warns, has_ranges;
    } rows[] = {{0.3, 1, 0}, {60, 1, 1}, {99999, 1, 1}, {100001, 0, 1}, {899999, 0, 1}, {900001, 1, 1}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[128], *printed = NULL;
        size_t len = 0;
        write_floor(rows[i].easting_m, 0, 0);
        snprintf(text, sizeof text, "  - {position_m: [%.1f, 0, 2]}\n  - {position_m: [%.1f, 1, 2]}", rows[i].easting_m,
                 rows[i].easting_m);
        ok(load(anchor, text, "local"));
        const char *far = strstr(warned, " m is far outside of the scene's grid (scene.anchor), whose eastings are 1");
        assert_int_equal(far != NULL, rows[i].warns);
        if (far != NULL && strstr(far + 8, "far outside") != NULL) fail_msg("%s", warned);
        FILE *out = open_memstream(&printed, &len);
        check_print_station(site, 0, out);
        fclose(out);
        assert_int_equal(strstr(printed, "ranges are grid lengths") != NULL, rows[i].has_ranges);
        assert_non_null(strstr(printed, "y axis"));
        free(printed);
    }
}

static void the_house_has_its_site(void **state)
{
    (void)state;
    static const char house[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";
    if (access(house, R_OK) != 0) {
        print_message("the house model is not installed (Debian: assimp-testmodels)\n");
        skip();
    }
    static const char text[] =
        "head: {profile: riegl-vz400i}\n"
        "scene:\n  ifc_reader: assimp\n  meshes: [{file: /usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc, up: %s, scale: %g, "
        "offset_m: [100, 0, 0]}]\n  anchor: {source: ifc%s}\n"
        "stations:\n  - {position_m: [100, 0, 0]}\n  - {position_m: [105.5, 2.2, 1], instrument_height_m: 1.6}\n"
        "output: {crs: utm, layout: geo}\n";
    static const struct {
        const char *up;
        double scale;
        const char *height, *part;
    } at[] = {{"y", 1, "", NULL},
              {"y", 1, ", height_m: 110", NULL},
              {"z", 1, "", "allowed up: y"},
              {"y", 0.5, "", "scale: 1"}};
    for (int i = 0; i < 4; i++) {
        char edited[1024];
        snprintf(edited, sizeof edited, text, at[i].up, at[i].scale, at[i].height);
        write_in("test.yaml", edited);
        site_free(site);
        site = NULL;
        clear_warned();
        ok(config_load(config_path, NULL, 0, cfg, &err));
        int code = site_load(cfg, &report, &site, &err);
        if (at[i].part != NULL) {
            assert_int_equal(code, SH_EINPUT);
            assert_non_null(strstr(err.text, at[i].part));
            continue;
        }
        ok(code);
        assert_near(site->station[0].at.place.lat_deg, 52.0 + 31.0 / 60, 1e-12);
        assert_near(site->station[0].at.place.lon_deg, 13.4, 1e-12);
        assert_near(site->station[0].at.place.height_m, i == 0 ? 0 : 110, 1e-8);
        assert_near(site->station[1].at.position_m[2], 1.6, 1e-6); /* the ground floor, in single precision */
    }
}

/* Makes a slab of 8 x 8 m. The slab's x axis points 30 deg to the left of grid east. Scene and grid agree but for the
 * grid's scale. */
static const char mapped_ifc[] =
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('a','2026-01-01T00:00:00',(''),(''),'','','');\n"
    "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n#1=IFCPERSON($,'a',$,$,$,$,$,$);\n"
    "#2=IFCORGANIZATION($,'a',$,$,$);\n#3=IFCPERSONANDORGANIZATION(#1,#2,$);\n#4=IFCAPPLICATION(#2,'1','a','a');\n"
    "#5=IFCOWNERHISTORY(#3,#4,$,.ADDED.,$,$,$,0);\n#6=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\n#8=IFCUNITASSIGNMENT((#6));\n"
    "#9=IFCCARTESIANPOINT((0.,0.,0.));\n#10=IFCDIRECTION((0.,0.,1.));\n#12=IFCAXIS2PLACEMENT3D(#9,$,$);\n"
    "#13=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#12,$);\n"
    "#14=IFCPROJECTEDCRS('EPSG:32632',$,$,$,$,$,$);\n"
    "#15=IFCMAPCONVERSION(#13,#14,691000.,5334000.,520.,0.866025403784439,0.5,1.);\n"
    "#16=IFCPROJECT('0YvctVUKr0kugbFTf50000',#5,'p',$,$,$,$,(#13),#8);\n#21=IFCLOCALPLACEMENT($,#12);\n"
    "#22=IFCSITE('0YvctVUKr0kugbFTf50001',#5,'site',$,$,#21,$,$,.ELEMENT.,(47,0,0),(11,0,0),$,$,$);\n"
    "#23=IFCRELAGGREGATES('0YvctVUKr0kugbFTf50002',#5,$,$,#16,(#22));\n#25=IFCCARTESIANPOINT((0.,0.));\n"
    "#26=IFCAXIS2PLACEMENT2D(#25,$);\n#27=IFCRECTANGLEPROFILEDEF(.AREA.,$,#26,8.,8.);\n"
    "#33=IFCEXTRUDEDAREASOLID(#27,#12,#10,0.5);\n#34=IFCSHAPEREPRESENTATION(#13,'Body','SweptSolid',(#33));\n"
    "#35=IFCPRODUCTDEFINITIONSHAPE($,$,(#34));\n"
    "#41=IFCBUILDINGELEMENTPROXY('0YvctVUKr0kugbFTf50003',#5,'slab',$,$,#21,#35,$,$);\n"
    "#42=IFCRELCONTAINEDINSPATIALSTRUCTURE('0YvctVUKr0kugbFTf50004',#5,$,$,(#41),#22);\nENDSEC;\nEND-ISO-10303-21;\n";

static void a_map_conversion_goes_before_a_site(void **state)
{
    (void)state;
    struct georef_place want;
    double azimuth_deg, from_grid_deg;
    write_in("mapped.ifc", mapped_ifc);
    write_in("test.yaml", "head: {profile: riegl-vz400i}\nscene:\n  ifc_reader: assimp\n"
                          "  meshes: [{file: mapped.ifc, up: y, scale: 1}]\n  anchor: {source: ifc}\n"
                          "stations:\n  - {position_m: [3, 2, 2], heading_deg: 0}\noutput: {crs: utm, layout: geo}\n");
    site_free(site);
    site = NULL;
    clear_warned();
    ok(config_load(config_path, NULL, 0, cfg, &err));
    const int rc = site_load(cfg, &report, &site, &err);
    if (rc != SH_OK && strstr(err.text, "Unrecognized file schema: IFC4") != NULL) skip(); /* Assimp 5.4 of Debian 13 */
    ok(rc);
    /* 3 along x and 2 along y, turned by 30 deg; 0.03 % of grid scale on 3.6 m are 1.1 mm, 1e-8 deg. */
    const double c = cos(M_PI / 6), grid_m[3] = {691000 + 3 * c - 2 * 0.5, 5334000 + 3 * 0.5 + 2 * c, 522};
    ok(georef_locate_utm(32, 1, grid_m, &want, &err));
    assert_near(site->station[0].at.place.lat_deg, want.lat_deg, 1.5e-8);
    assert_near(site->station[0].at.place.lon_deg, want.lon_deg, 1.5e-8);
    assert_near(site->station[0].at.place.height_m, 522, 1e-5);
    /* Heading 0 is the model's y, 30 deg left of grid north. The second angle is from the grid. */
    read_azimuths(&azimuth_deg, &from_grid_deg);
    assert_near(remainder(from_grid_deg + 30, 360), 0, 1e-6);
    assert_non_null(strstr(warned, "OrthogonalHeight counts from sea level"));
    /* 1.13 deg of latitude are 126 km, and 0.57 deg of longitude 43 km: 133 km. */
    const char *apart = strstr(warned, "its IFCSITE is ");
    assert_non_null(apart);
    assert_near(atof(apart + strlen("its IFCSITE is ")), 133, 1);
    assert_non_null(strstr(apart, " km from the place that its IFCMAPCONVERSION gives"));
}

static int tear_down(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_form_leads_to_the_same_place),
        cmocka_unit_test(the_equator_and_the_edge_of_ups_do_not_part_stations),
        cmocka_unit_test(instrument_height_moves_the_height_on_the_earth),
        cmocka_unit_test(a_zone_border_does_not_part_stations),
        cmocka_unit_test(a_mesh_in_utm),
        cmocka_unit_test(a_place_in_the_other_hemisphere_s_grid),
        cmocka_unit_test(a_mesh_in_ecef),
        cmocka_unit_test(an_instrument_height_counts_from_the_floor),
        cmocka_unit_test(what_has_no_place_is_refused),
        cmocka_unit_test(headings_and_convergence),
        cmocka_unit_test(a_map_conversion_goes_before_a_site),
        cmocka_unit_test(a_place_at_the_edge_of_utm),
        cmocka_unit_test(the_house_has_its_site),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, tear_down);
}
