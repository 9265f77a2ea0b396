/* SPDX-License-Identifier: MIT */
/* These are tests of map conversions in IFC files: factors of axes, and several conversions in one file. */
#include <math.h>

#include "core/ifc_site.h"
#include "tests/unit/scene_files.h"

static struct ifc_site site;
static struct sh_err err;

/* The model is in millimetres. */
static int load_map(const char *records)
{
    static const char format[] = "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n"
                                 "#1= IFCPROJECT('p',$,$,$,$,$,$,(#5),#2);\n#2= IFCUNITASSIGNMENT((#3));\n"
                                 "#3= IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.);\n"
                                 "#5= IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#6,$);\n"
                                 "#6= IFCAXIS2PLACEMENT3D(#7,$,$);\n#7= IFCCARTESIANPOINT((0.,0.,0.));\n%s"
                                 "ENDSEC;\nEND-ISO-10303-21;\n";
    char text[2048];
    snprintf(text, sizeof text, format, records);
    memset(&err, 0, sizeof err);
    const int code = ifc_site_read(write_text("a.ifc", text), &site, &err);
    unlink(path);
    return code;
}

static void assert_loads(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

/* The bound allows some roundings. */
static void assert_near(double got, double want)
{
    if (!(fabs(got - want) <= 1e-14 * (1.0 + fabs(want)))) fail_msg("%.17g instead of %.17g", got, want);
}

/* IFC 4.3: Scale and then a factor for each axis. The model is in millimetres. */
static void factors_of_a_map_conversion(void **state)
{
    (void)state;
    static const struct {
        const char *scale, *unit, *error;
        double unit_m;
    } rows[] = {
        {"1.,0.001,0.001,0.001", "$", NULL, 1.0},
        {"1.,0.001,0.001,0.001", "#22", NULL, 1.0},
        {"$,0.001,0.001,0.001", "$", NULL, 1.0},
        {"0.001,1.,1.,1.", "$", NULL, 1.0},
        {"0.001,0.9996,0.9996,1.", "#22", NULL, 1.0}, /* a grid's own scale */
        {"1.,0.9996,0.9996,1.", "#22", NULL, 1.0},    /* Scale says nothing, and MapUnit says it */
        {"1.,1.,1.,1.", "$", NULL, 0.001},            /* the model's own unit */
        {"0.001,3.2808398950131,3.2808398950131,3.2808398950131", "$", NULL, 0.3048},
        {"0.001,1.,1.,2.", "$",
         "IFCMAPCONVERSIONSCALED #20: factors of 1, 1 and 2 for the axes; allowed within 1 % of each other", 0},
        {"0.001,1.,0.5,1.", "#22", "factors of 1, 0.5 and 1 for the axes", 0},
        {"0.001,0.,0.,0.", "$", "a factor of an axis that is not above 0", 0},
        {"0.001,1.,1.,-1.", "$", "a factor of an axis that is not above 0", 0},
        {"0.001,x,1.,1.", "$", "FactorX is missing, or is not a number", 0},
        {"1.,0.5,0.5,0.5", "#22", "a Scale of 0.5 beside a MapUnit; allowed about 0.001", 0},
        {"1.,0.5,0.5,0.5", "$", "its Scale fits no unit of maps", 0},
        {"0.001", "$", "IFCMAPCONVERSIONSCALED #20: not the 11 attributes that IFC defines", 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char more[512];
        snprintf(
            more, sizeof more,
            "#20= IFCMAPCONVERSIONSCALED(#5,#21,2000.,1000.,30.,1.,0.,%s);\n#21= IFCPROJECTEDCRS('a',$,$,$,$,$,%s);\n"
            "#22= IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\n",
            rows[i].scale, rows[i].unit);
        const int code = load_map(more);
        if (rows[i].error != NULL) {
            if (code != SH_EINPUT || strstr(err.text, rows[i].error) == NULL) fail_msg("case %zu: %s", i, err.text);
            continue;
        }
        assert_loads(code);
        assert_near(site.map.easting_m, 2000.0 * rows[i].unit_m);
        assert_near(site.map.height_m, 30.0 * rows[i].unit_m);
    }
}

/* The context of the model has one, and that of plans another one. They have to say the same, in whatever words. */
static void several_map_conversions(void **state)
{
    (void)state;
    static const struct {
        const char *second;
        int code;
    } rows[] = {{"#21,1.,2.,$,1.,0.,0.001", SH_OK},      {"#23,1.,2.,$,1.,0.,0.001", SH_OK},
                {"#23,1.,2.,$,$,$,0.001", SH_OK},        {"#24,1.,2.,$,1.,0.,0.001", SH_EINPUT},
                {"#21,1.5,2.,$,1.,0.,0.001", SH_EINPUT}, {"#21,1.,2.5,$,1.,0.,0.001", SH_EINPUT},
                {"#21,1.,2.,0.,1.,0.,0.001", SH_EINPUT}, {"#21,1.,2.,$,1.,0.1,0.001", SH_EINPUT},
                {"#21,1.,2.,$,1.,0.,$", SH_EINPUT}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char more[512];
        snprintf(more, sizeof more,
                 "#20= IFCMAPCONVERSION(#5,#21,1.,2.,$,1.,0.,0.001);\n#21= IFCPROJECTEDCRS('a',$,$,$,$,$,$);\n"
                 "#22= IFCMAPCONVERSION(#5,%s);\n#23= IFCPROJECTEDCRS('a','words',$,$,$,$,$);\n"
                 "#24= IFCPROJECTEDCRS('b',$,$,$,$,$,$);\n",
                 rows[i].second);
        const int code = load_map(more);
        if (code != rows[i].code) fail_msg("case %zu: %s", i, err.text);
        if (code != SH_OK)
            assert_non_null(
                strstr(err.text, "IFCMAPCONVERSION #22: a second map conversion, which says something else"));
        else
            assert_near(site.map.easting_m, 1.0);
    }
}

/* A foot is 0.3048 m, and a US survey foot 1200 / 3937 m: the axes of EPSG:2225 (California, zone 1) are in the latter,
 * those of EPSG:2222 (Arizona, east) in the former (EPSG registry). They differ by 2e-6, and maps have scales of their
 * own. So the system decides, and where PROJ does not know it, the nearest one. */
static void feet_of_two_kinds(void **state)
{
    (void)state;
    static const double FOOT_M = 0.3048, SURVEY_FOOT_M = 1200.0 / 3937.0;
    static const struct {
        const char *crs, *scale;
        double unit_m;
    } rows[] = {
        {"EPSG:2225", "0.00328083333333333", SURVEY_FOOT_M},
        {"EPSG:2225", "0.00328083989501312", SURVEY_FOOT_M},
        {"EPSG:2225", "0.0032801", SURVEY_FOOT_M},
        {"EPSG:2225", "0.001", 1.0}, /* the file says metres */
        {"EPSG:2222", "0.00328083333333333", FOOT_M},
        {"EPSG:2222", "0.0032815", FOOT_M},
        {"local", "0.00328083333333333", SURVEY_FOOT_M},
        {"local", "0.00328083989501312", FOOT_M},
        {"local", "0.0032801", SURVEY_FOOT_M},
        {"local", "0.0032815", FOOT_M},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char more[512];
        snprintf(more, sizeof more,
                 "#20= IFCMAPCONVERSION(#5,#21,6500000.,2000000.,5.,1.,0.,%s);\n"
                 "#21= IFCPROJECTEDCRS('%s',$,$,$,$,$,$);\n",
                 rows[i].scale, rows[i].crs);
        assert_loads(load_map(more));
        assert_near(site.map.easting_m, 6500000.0 * rows[i].unit_m);
        assert_near(site.map.height_m, 5.0 * rows[i].unit_m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(factors_of_a_map_conversion),
        cmocka_unit_test(feet_of_two_kinds),
        cmocka_unit_test(several_map_conversions),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
