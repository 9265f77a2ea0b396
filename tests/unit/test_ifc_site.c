/* SPDX-License-Identifier: MIT */
/* These are tests of the site of an IFC model, with files of the test and with the house that Debian ships. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/ifc_site.h"

static char path[64];
static struct ifc_site site;
static struct sh_err err;

/* Records come after those that refer to them: a reader may not rely on an order. */
static const char base[] = "ISO-10303-21;\nHEADER;\nFILE_NAME('a;b''#1= IFCSITE(','x');\nENDSEC;\nDATA;\n"
                           "#1= IFCPROJECT('p',$,$,$,$,$,$,(#5),#2);\n"
                           "#2= IFCUNITASSIGNMENT((#4,#3));\n"
                           "#3= IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);\n"
                           "#4= IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.);\n"
                           "#5= IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#6,#9);\n"
                           "#6= IFCAXIS2PLACEMENT3D(#7,$,$);\n"
                           "#7= IFCCARTESIANPOINT((0.,0.,0.));\n"
                           "#8= IFCSITE('s',$,'x;',$,$,#10,$,$,.ELEMENT.,(52,31,30,500000),(13,24,0),34500.,$,$);\n"
                           "#9= IFCDIRECTION((1.,1.));\n"
                           "#10= IFCLOCALPLACEMENT($,#11);\n"
                           "#11= IFCAXIS2PLACEMENT3D(#12,$,$);\n"
                           "#12= IFCCARTESIANPOINT((1000.,-2000.,\n  500.));\n"
                           "ENDSEC;\nEND-ISO-10303-21;\n";

static int load_text(const char *text)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
    memset(&err, 0, sizeof err);
    return ifc_site_read(path, &site, &err);
}

static int load_edited(const char *old, const char *with)
{
    char text[4096];
    const char *at = strstr(base, old);
    if (at == NULL) fail_msg("nothing to edit: %s", old);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - base), base, with, at + strlen(old));
    return load_text(text);
}

static void assert_loads(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

/* The bound allows some roundings for each term of the sum. */
static void assert_near(double got, double want)
{
    if (!(fabs(got - want) <= 1e-14 * (1.0 + fabs(want)))) fail_msg("%.17g instead of %.17g", got, want);
}

static void a_site_is_read(void **state)
{
    (void)state;
    assert_loads(load_text(base));
    assert_near(site.lat_deg, 52.0 + 31.0 / 60 + 30.5 / 3600);
    assert_near(site.lon_deg, 13.4);
    assert_near(site.elevation_m, 34.5); /* millimetres */
    assert_near(site.origin_m[0], 1.0);
    assert_near(site.origin_m[1], -2.0);
    assert_near(site.origin_m[2], 0.5);
    assert_near(site.north_deg, 45.0); /* between x and y, clockwise from y */
    assert_true(!site.has_map);
}

static void what_is_not_given(void **state)
{
    (void)state;
    assert_loads(load_edited("34500.", "$"));
    assert_true(isnan(site.elevation_m));
    assert_loads(load_edited("#6,#9)", "#6,$)"));
    assert_true(site.north_deg == 0.0);
    assert_loads(load_edited("$,$,#10,$", "$,$,$,$")); /* no placement: the origin */
    assert_true(site.origin_m[0] == 0.0 && site.origin_m[1] == 0.0 && site.origin_m[2] == 0.0);
    assert_loads(load_edited("#9= ", "/* #8= IFCSITE(; */ #9= "));
    /* A plan's own context and a site without angles do not count. */
    assert_loads(load_edited("#5= ", "#21= IFCGEOMETRICREPRESENTATIONCONTEXT($,'Plan',2,$,#6,$);\n"
                                     "#23= IFCSITE('t',$,$,$,$,$,$,$,.PARTIAL.,$,$,$,$,$);\n#5= "));
    assert_near(site.north_deg, 45.0);
}

/* A byte order mark is ignored. */
static void byte_order_mark(void **state)
{
    (void)state;
    char text[sizeof base + 3];
    snprintf(text, sizeof text, "\xef\xbb\xbf%s", base);
    assert_loads(load_text(text));
    assert_near(site.lon_deg, 13.4);
}

static void angles(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double deg;
    } good[] = {{"(-13,-24,0)", -13.4},
                {"(0,-30,0)", -0.5},
                {"(0,0,-36)", -0.01},
                {"(0,0,0,-360000)", -0.0001},
                {"(179,59,59,999999)", 180.0 - 1 / 3.6e9},
                {"(-180,0,0)", -180.0},
                {"( 13 , 24 , 0 )", 13.4}};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        assert_loads(load_edited("(13,24,0)", good[i].text));
        assert_near(site.lon_deg, good[i].deg);
    }
    assert_loads(load_edited("(52,31,30,500000)", "(-33,-52,-10)"));
    assert_near(site.lat_deg, -(33.0 + 52.0 / 60 + 10.0 / 3600));
}

static void units(void **state)
{
    (void)state;
    assert_loads(load_edited(".MILLI.", "$"));
    assert_near(site.elevation_m, 34500.0);
    assert_loads(load_edited("#3= IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);",
                             "#3= IFCCONVERSIONBASEDUNIT($,.LENGTHUNIT.,'FOOT',#31);\n"
                             "#31= IFCMEASUREWITHUNIT(IFCLENGTHMEASURE(0.3048),#32);\n"
                             "#32= IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);"));
    assert_near(site.elevation_m, 34500.0 * 0.3048);
    assert_near(site.origin_m[1], -2000.0 * 0.3048);
}

/* The prefixes are those of ISO 1000, as IFC names them. */
static void prefixes(void **state)
{
    (void)state;
    static const struct {
        const char *prefix;
        double m;
    } row[] = {{".MILLI.", 1e-3}, {".CENTI.", 1e-2}, {".DECI.", 0.1},   {".MICRO.", 1e-6},
               {".KILO.", 1e3},   {".DECA.", 10.0},  {".HECTO.", 100.0}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        assert_loads(load_edited(".MILLI.", row[i].prefix));
        assert_near(site.elevation_m, 34500.0 * row[i].m);
        assert_near(site.origin_m[2], 500.0 * row[i].m);
    }
}

static void wrong_units_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *foot, *measure, *part;
    } bad[] = {
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(0.),#32", "#31: the factor of a length unit is missing"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(-1.),#32", "#31: the factor of a length unit is missing"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(x),#32", "#31: the factor of a length unit is missing"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "0.3048,#32", "#31: the factor of a length unit is missing"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(0.3048)", "#31: attributes are missing"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(0.3048),#4", "not a unit of length"},
        {"$,.LENGTHUNIT.,'FOOT',#31", "IFCLENGTHMEASURE(0.3048),#12", "#31: a reference to IFCSIUNIT is missing"},
        {"$,.LENGTHUNIT.,'FOOT',#32", "IFCLENGTHMEASURE(0.3048),#32",
         "#3: a reference to IFCMEASUREWITHUNIT is missing"},
        {"$,.LENGTHUNIT.,'FOOT'", "IFCLENGTHMEASURE(0.3048),#32", "no unit of length"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char with[256];
        snprintf(with, sizeof with,
                 "#3= IFCCONVERSIONBASEDUNIT(%s);\n#31= IFCMEASUREWITHUNIT(%s);\n"
                 "#32= IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);",
                 bad[i].foot, bad[i].measure);
        const int code = load_edited("#3= IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);", with);
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d \"%s\" without \"%s\"", i, code, err.text, bad[i].part);
    }
}

/* The model is in millimetres. */
static int load_map(const char *map, const char *crs)
{
    char text[512];
    snprintf(text, sizeof text,
             "#20= IFCMAPCONVERSION(#5,#21,%s);\n#21= IFCPROJECTEDCRS(%s);\n"
             "#22= IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\nENDSEC;\nEND",
             map, crs);
    return load_edited("ENDSEC;\nEND", text);
}

static void a_map_conversion(void **state)
{
    (void)state;
    static const struct {
        const char *map, *crs;
        double easting_m, x_axis_rad;
    } good[] = {
        /* The system gives its unit. */
        {"2000.5,1000.25,30.,0.,1.,0.001", "'EPSG:2056',$,$,$,$,$,#22", 2000.5, M_PI / 2},
        /* Where the system gives no unit, Scale shows it: 0.001 is metres, 0.0033 feet, a missing one the model's own
         * millimetres. A grid's own scale of 0.9996 changes nothing. */
        {"2000.5,1000.25,30.,$,$,0.001", "'EPSG:2056',$,$,$,$,$,$", 2000.5, 0.0},
        {"2000.5,1000.25,30.,1.,-1.,0.0009996", "'EPSG:2056',$,$,$,$,$,$", 2000.5, -M_PI / 4},
        {"2000.5,1000.25,30.,0.,1.,0.0009996", "'EPSG:2056',$,$,$,$,$,#22", 2000.5, M_PI / 2},
        {"2000.5,1000.25,30.,0.,1.,$", "'EPSG:2056',$,$,$,$,$,#22", 2000.5, M_PI / 2},
        {"2000.5,1000.25,30.,1.,0.,$", "'EPSG:2056',$,$,$,$,$,$", 2.0005, 0.0},
        {"2000.5,1000.25,30.,1.,0.,0.0032808398950131", "'EPSG:2056',$,$,$,$,$,$", 2000.5 * 0.3048, 0.0}};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        const double unit_m = good[i].easting_m / 2000.5;
        assert_loads(load_map(good[i].map, good[i].crs));
        assert_true(site.has_map && site.has_place);
        assert_string_equal(site.map.crs, "EPSG:2056");
        assert_near(site.map.easting_m, good[i].easting_m);
        assert_near(site.map.northing_m, 1000.25 * unit_m);
        assert_near(site.map.height_m, 30.0 * unit_m);
        assert_near(site.map.x_axis_rad, good[i].x_axis_rad);
    }
    assert_loads(load_map("1.,2.,$,1.,0.,0.001", "'EPSG:2056',$,$,$,$,$,$"));
    assert_true(isnan(site.map.height_m));
    /* A map conversion needs no place of the site. */
    assert_loads(load_edited("(52,31,30,500000),(13,24,0),34500.,$,$);",
                             "$,$,$,$,$);\n#20= IFCMAPCONVERSION(#5,#21,1.,2.,3.,$,$,0.001);\n"
                             "#21= IFCPROJECTEDCRS('EPSG:25832',$,$,$,$,$,$);"));
    assert_true(site.has_map && !site.has_place);
}

static void wrong_map_conversions_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *map, *crs, *part;
    } bad[] = {{"1.,2.,3.,$,$", "'a',$,$,$,$,$,$", "IFCMAPCONVERSION #20: not the 8 attributes"},
               {"1.,$,3.,$,$,0.001", "'a',$,$,$,$,$,$", "IFCMAPCONVERSION #20: Northings is missing"},
               {"1.,2.,3.,0.,0.,0.001", "'a',$,$,$,$,$,$", "an x axis without a direction"},
               {"1.,2.,3.,$,$,0.", "'a',$,$,$,$,$,$", "a Scale that is not above 0"},
               {"1.,2.,3.,$,$,0.5", "'a',$,$,$,$,$,$", "its Scale fits no unit of maps"},
               {"1.,2.,3.,$,$,7.", "'a',$,$,$,$,$,#22",
                "line 19: IFCMAPCONVERSION #20: a Scale of 7 beside a MapUnit; allowed about 0.001,"},
               {"1.,2.,3.,$,$,0.001", "'a',$,$", "IFCPROJECTEDCRS #21: attributes are missing"},
               {"1.,2.,3.,$,$,0.001", "$,$,$,$,$,$,$", "IFCPROJECTEDCRS #21: its name is missing"},
               {"1.,2.,3.,$,$,0.001", "'a',$,$,$,$,$,#4", "not a unit of length"},
               {"1.,2.,3.,$,$,0.001", "'a',$,$,$,$,$,#0", "IFCPROJECTEDCRS #21 refers to #0, but there is no such"},
               {"1.,2.,3.,$,$,0.001", "'a',$,$,$,$,#,#99", "IFCPROJECTEDCRS #21 refers to #0, but there is no such"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        int code = load_map(bad[i].map, bad[i].crs);
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d \"%s\" without \"%s\"", i, code, err.text, bad[i].part);
    }
}

static void what_is_wrong_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *part;
    } bad[] = {
        {"#8= IFCSITE", "#8= IFCBUILDING", "no IFCSITE with RefLatitude"},
        {"(52,31,30,500000),(13,24,0)", "$,$", "no IFCSITE with RefLatitude"},
        {"(13,24,0)", "$", "RefLongitude has 0 components"},
        {"(13,24,0)", "(13,24)", "line 13: IFCSITE #8: RefLongitude has 2 components; allowed 3 or 4"},
        {"(13,24,0)", "(13,24,0,0,0)", "RefLongitude has 5 components"},
        {"(13,24,0)", "13.4", "RefLongitude has 0 components"},
        {"(13,24,0)", "(-13,24,0)", "different sign"},
        {"(13,24,0)", "(13,60,0)", "component 2 is not a whole number within 60"},
        {"(13,24,0)", "(13,24,0.5)", "component 3 is not a whole number"},
        {"(13,24,0)", "(13,24,0,1000000)", "component 4"},
        {"(13,24,0)", "(180,0,1)", "allowed -180 to 180"},
        {"(52,31,30,500000)", "(90,0,0,1)", "allowed -90 to 90"},
        {"34500.", "'34500'", "RefElevation is not a number"},
        {",$,$);\n#9", ",$);\n#9", "not the 14 attributes"},
        {"#10= IFCLOCALPLACEMENT($", "#10= IFCLOCALPLACEMENT(#6", "relative to another"},
        {"$,$,#10,$", "$,$,#99,$", "line 13: IFCSITE #8 refers to #99, but there is no such record"},
        {"$,$,#10,$", "$,$,#12,$", "a reference to IFCLOCALPLACEMENT"},
        {"$,$,#10,$", "$,$,10,$", "a reference to IFCLOCALPLACEMENT"},
        {"#7= IFCCARTESIANPOINT((0.,0.,0.));", "#7= IFCCARTESIANPOINT((0.,1.,0.));", "WorldCoordinateSystem"},
        {"(1.,1.)", "(0.,0.)", "without a direction"},
        {"(1.,1.)", "(1.,x)", "not a number"},
        {".MILLI.", ".FURLONG.", "unknown prefix"},
        {".LENGTHUNIT.", ".AREAUNIT.", "no unit of length"},
        {"#10= IFC", "#10 IFC", "no record of the form"},
        {"ENDSEC;\nEND", "#40= IFCSITE('s',$,$,$,$,$,$,$,.ELEMENT.,(1,2,3),(1,2,3),$,$,$);\nENDSEC;\nEND",
         "a second site"},
        {"ISO-10303-21;\nH", "ISO\nH", "doesn't begin with ISO-10303-21"},
        {"END-ISO-10303-21;", "#13= IFCWALL(", "cut off"},
        {"END-ISO-10303-21;", "'", "a text without an end"},
        {"END-ISO-10303-21;", "/*", "a comment without an end"},
        {"#9= IFCDIRECTION", "#9 IFCDIRECTION", "no record of the form"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        int code = load_edited(bad[i].old, bad[i].with);
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d \"%s\" without \"%s\"", i, code, err.text, bad[i].part);
        if (strncmp(err.text, path, strlen(path)) != 0) fail_msg("case %zu: no file in \"%s\"", i, err.text);
        assert_null(strchr(err.text, '\n'));
    }
    assert_int_equal(ifc_site_read("/nonexistent.ifc", &site, &err), SH_EINPUT);
}

/* Diagnostics of the whole file name no line. */
static void what_is_wrong_of_the_whole_file(void **state)
{
    (void)state;
#define ADVICE "; use scene.anchor.source: explicit, which needs none of this"
    static const struct {
        const char *old, *with, *says;
    } bad[] = {
        {"#1= IFCPROJECT(", "#1= IFCWALL(", ": 0 IFCPROJECT records; allowed one" ADVICE},
        {"#9= ", "#20= IFCPROJECT('p',$,$,$,$,$,$,(#5),#2);\n#9= ", ": 2 IFCPROJECT records; allowed one" ADVICE},
        {"END-ISO-10303-21;", "END", ": cut off: it doesn't end with END-ISO-10303-21;"},
        {"#9= IFCDIRECTION", "#7= IFCDIRECTION", ", line 14: a second record #7; allowed one"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(load_edited(bad[i].old, bad[i].with), SH_EINPUT);
        assert_memory_equal(err.text, path, strlen(path));
        assert_string_equal(err.text + strlen(path), bad[i].says);
    }
}

/* The end is looked for in the last 1024 bytes, or in the whole file where it is shorter. */
static void the_end_is_near(void **state)
{
    (void)state;
    static const char end[] = "END-ISO-10303-21;";
    char text[4096];
    const char *data = strstr(base, "#1= ");
    for (int size = 1023; size <= 1025; size++) { /* a comment fills it up */
        const int fill = size - (int)strlen(base);
        assert_true(fill > 4);
        snprintf(text, sizeof text, "%.*s/*%*s*/%s", (int)(data - base), base, fill - 4, "", data);
        assert_int_equal(strlen(text), size);
        assert_loads(load_text(text));
    }
    for (int after = 1024 - (int)strlen(end); after <= 1025 - (int)strlen(end); after++) {
        snprintf(text, sizeof text, "%s%*s", base, after - 1, ""); /* base has a line's end after it */
        assert_int_equal(load_text(text), after <= 1024 - (int)strlen(end) ? SH_OK : SH_EINPUT);
    }
}

/* Any cut and any changed byte gives a site or one line. */
static void damaged_files_never_crash(void **state)
{
    (void)state;
    static const char spice[] = "#()',;=$*./ \n09-";
    char text[sizeof base];
    for (size_t i = 0; i < sizeof base - 1; i++) {
        memcpy(text, base, sizeof base);
        text[i] = '\0';
        load_text(text);
        memcpy(text, base, sizeof base);
        text[i] = spice[i % (sizeof spice - 1)];
        int code = load_text(text);
        assert_true(code == SH_OK || code == SH_EINPUT);
    }
}

/* The values are those of its record: 52 deg 31 min N, 13 deg 24 min E, no elevation. */
static void the_house(void **state)
{
    (void)state;
    static const char house[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";
    if (access(house, R_OK) != 0) {
        print_message("the house model is not installed (Debian: assimp-testmodels)\n");
        skip();
    }
    assert_loads(ifc_site_read(house, &site, &err));
    assert_near(site.lat_deg, 52.0 + 31.0 / 60);
    assert_near(site.lon_deg, 13.4);
    assert_true(isnan(site.elevation_m) && !site.has_map);
    assert_near(site.north_deg, 0.0);
}

static int set_up(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "/tmp/test_ifc_site.XXXXXX");
    int fd = mkstemp(path);
    return fd < 0 ? -1 : close(fd);
}

static int tear_down(void **state)
{
    (void)state;
    return remove(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_site_is_read),
        cmocka_unit_test(what_is_not_given),
        cmocka_unit_test(byte_order_mark),
        cmocka_unit_test(angles),
        cmocka_unit_test(units),
        cmocka_unit_test(prefixes),
        cmocka_unit_test(wrong_units_are_refused),
        cmocka_unit_test(a_map_conversion),
        cmocka_unit_test(wrong_map_conversions_are_refused),
        cmocka_unit_test(what_is_wrong_is_refused),
        cmocka_unit_test(what_is_wrong_of_the_whole_file),
        cmocka_unit_test(the_end_is_near),
        cmocka_unit_test(damaged_files_never_crash),
        cmocka_unit_test(the_house),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
