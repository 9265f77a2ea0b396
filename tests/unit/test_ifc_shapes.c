/* SPDX-License-Identifier: MIT */
/* The representations of products in IFC files: which of them are the body, and what the readers of bodies get, of
 * points with an index too. No reader of bodies is needed. */
#include "core/import/ifc/ifc_records.h"
#include "tests/unit/ifc_files.h"
#include "tests/unit/scene_files.h"

static char text[IFC_TEXT_ROOM], edited[IFC_TEXT_ROOM];
static struct ifc_records records;
static struct sh_err err;

/* The items are a box, a curve, a bounding box, a set of the curve, a set of a surface, and a type that nobody knows.
 * The contexts are those of the model, of a sketch, of the model at 1:100 and at 1:50, and of two views of the user. */
static const char common[] =
    "#7000=IFCPOLYLINE((#9,#9));\n#7001=IFCBOUNDINGBOX(#9,1.,1.,1.);\n#7002=IFCGEOMETRICSET((#7000));\n"
    "#7003=IFCGEOMETRICSET((#7000,#7004));\n#7004=IFCCURVEBOUNDEDPLANE(#7005,#7000,());\n#7005=IFCPLANE(#12);\n"
    "#7006=IFCFUTURESOLID(#12);\n"
    "#7010=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,$,.MODEL_VIEW.,$);\n"
    "#7011=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,$,.SKETCH_VIEW.,$);\n"
    "#7012=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,0.01,.MODEL_VIEW.,$);\n"
    "#7013=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,0.02,.MODEL_VIEW.,$);\n"
    "#7014=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,$,.USERDEFINED.,'LOD2');\n"
    "#7015=IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#13,$,.USERDEFINED.,'LOD3');\n"
    "#7020=IFCSHAPEREPRESENTATION(#13,'Body','SweptSolid',(#1060));\n#7021=IFCREPRESENTATIONMAP(#12,#7020);\n"
    "#7022=IFCMAPPEDITEM(#7021,#12);\n"
    "#7023=IFCSHAPEREPRESENTATION(#13,'Clearance','SweptSolid',(#1060));\n#7024=IFCREPRESENTATIONMAP(#12,#7023);\n"
    "#7025=IFCMAPPEDITEM(#7024,#12);\n#7026=IFCGEOMETRICSET((#7026,#7026));\n"
    "#7027=IFCSHAPEREPRESENTATION(#13,'FootPrint','Curve2D',(#7000));\n#7028=IFCREPRESENTATIONMAP(#12,#7027);\n"
    "#7029=IFCMAPPEDITEM(#7028,#12);\n#7030=IFC2DCOMPOSITECURVE((#7031),.U.);\n"
    "#7031=IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,#7000);\n#7032=IFCBEZIERCURVE(1,(#9,#9),.UNSPECIFIED.,.F.,.F.);\n"
    "#7033=IFCRATIONALBEZIERCURVE(1,(#9,#9),.UNSPECIFIED.,.F.,.F.,(1.,1.));\n"
    "#7034=IFCLINEARDIMENSION((#7000));\n#7035=IFCGEOMETRICSET((#7030,#7032,#7033,#7034));\n"
    "#6100=IFCPRODUCTDEFINITIONSHAPE($,$,(#6000, #6001\n,#6002));\n"
    "#6101=IFCWALL('guid_of_wall',#5,'wall',$,$,#1003,#6100,$,$);\n"
    "#6102=IFCWALL('guid_of_other',#5,'other',$,$,#1003,#6100,$,$);\n";

#define CURVE "#13,'Axis','Curve2D',(#7000)"

/* kept: '1' for each representation that stays. flags: b has_body, x is_boxed, u is_unbodied, l is_level. */
struct row {
    const char *rep[3], *kept, *flags;
};

static void set_text(const struct row *row)
{
    char more[4096];
    size_t n = (size_t)snprintf(more, sizeof more, "%s", common);
    for (int i = 0; i < 3; i++)
        n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCSHAPEREPRESENTATION(%s);\n", 6000 + i, row->rep[i]);
    ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, more);
}

/* Does what result.mjs does. */
static void apply_edits(void)
{
    size_t len, at = 0, size;
    int used;
    char *list = ifc_edits_write(&records.edits, &records.index.text, &len), *out = edited;
    assert_non_null(list);
    assert_int_equal(sscanf(list, "%zu\n%n", &size, &used), 1);
    assert_int_equal(size, strlen(text));
    for (const char *line = list + used; *line != '\0'; line = strchr(line, '\n') + 1) {
        size_t place, n;
        assert_int_equal(sscanf(line, "%zu %zu%n", &place, &n, &used), 2);
        line += used + 1;
        assert_true(place >= at && place + n <= size);
        out += sprintf(out, "%.*s%.*s", (int)(place - at), text + at, (int)strcspn(line, "\n"), line);
        at = place + n;
    }
    strcpy(out, text + at);
    free(list);
}

static void open_text(void)
{
    memset(&err, 0, sizeof err);
    if (ifc_records_open(&records, write_text("a.ifc", text), &err) != SH_OK) fail_msg("%s", err.text);
    unlink(path);
}

static void check_kept(const struct row *row)
{
    char list[64] = "", want[64] = "", all[256];
    snprintf(all, sizeof all, "%s", strstr(edited, "#6100=IFCPRODUCTDEFINITIONSHAPE"));
    for (const char *p = strchr(all, '('); *p != ')'; p++)
        if (strchr(" \n", *p) == NULL) strncat(list, p, 1);
    for (int i = 0; i < 3; i++)
        if (row->kept[i] == '1') sprintf(want + strlen(want), "%s#%d", *want != '\0' ? "," : "", 6000 + i);
    if (strcmp(list + strlen("($,$,("), want) != 0) fail_msg("%s: (%s), not (%s)", row->rep[0], list, want);
}

static void check_flags(const struct row *row, uint64_t id)
{
    const struct ifc_product *p = ifc_records_product(&records, id);
    char flags[8] = "";
    if (p->has_body) strcat(flags, "b");
    if (p->is_boxed) strcat(flags, "x");
    if (p->is_unbodied) strcat(flags, "u");
    if (p->is_level) strcat(flags, "l");
    if (strcmp(flags, row->flags) != 0) fail_msg("%s, #%d: '%s'", row->rep[0], (int)id, flags);
}

/* The names and their meaning are those of IfcShapeRepresentation in IFC 4.3. */
static void bodies_are_chosen(void **state)
{
    (void)state;
    static const struct row rows[] = {
        {{"#13,'Body','SweptSolid',(#1060)", "#13,'Clearance','SweptSolid',(#1060)", CURVE}, "101", "b"},
        {{"#13,'clearance','SweptSolid',(#1060)", "#13,'Body','SweptSolid',(#1060)", CURVE}, "011", "b"},
        {{"#13,'Reference','SweptSolid',(#1060)", "#13,'Lighting','SweptSolid',(#1060)",
          "#13,'Body','SweptSolid',(#1060)"},
         "001",
         "b"},
        {{"#13,'Body','SweptSolid',(#1060)", "#13,'Body-FallBack','Brep',(#1060)", "#13,'Surface','Surface3D',(#7004)"},
         "100",
         "b"},
        {{CURVE, "#13,'Body-FallBack','Brep',(#1060)", "#13,'Surface','Surface3D',(#7004)"}, "110", "b"},
        {{CURVE, CURVE, "#13,'Surface','Surface3D',(#7004)"}, "111", "b"},
        {{"#13,'FootPrint','GeometricCurveSet',(#7000)", CURVE, "#13,'Facetation','SurfaceModel',(#1060)"}, "111", "b"},
        {{"#13,'Facetation','SurfaceModel',(#1060)", "#13,'Body','SweptSolid',(#1060)", CURVE}, "011", "b"},
        /* A body that has only curves or a box is none, and nothing gives way to it. */
        {{"#13,'Body','Curve3D',(#7000)", "#13,'Body-FallBack','Brep',(#1060)", CURVE}, "111", "b"},
        {{"#13,'Body','BoundingBox',(#7001)", CURVE, CURVE}, "111", "x"},
        {{"#13,'Body','GeometricSet',(#7002)", CURVE, CURVE}, "111", ""},
        {{"#13,'Body','GeometricSet',(#7003)", CURVE, CURVE}, "111", "b"},
        {{"#13,'Body','GeometricSet',(#7026)", CURVE, CURVE}, "111", ""},
        /* Representations with a name that IFC does not define, or without one, stay. */
        {{"#13,'Shell','SweptSolid',(#1060)", "#13,'Body','SweptSolid',(#1060)", "#13,'Clearance','Brep',(#1060)"},
         "110",
         "b"},
        {{"#13,$,'SweptSolid',(#1060)", "#13,'','SweptSolid',(#1060)", "#13,'Axis','SweptSolid',(#1060)"}, "110", "b"},
        {{"#13,'3D','SweptSolid',(#7006)", CURVE, CURVE}, "111", "b"},
        /* A representation without a name has that of the one which it maps. */
        {{"#13,$,'MappedRepresentation',(#7022)", "#13,$,'MappedRepresentation',(#7025)", CURVE}, "101", "b"},
        {{"#13,'Body','MappedRepresentation',(#7025)", CURVE, CURVE}, "111", "b"},
        {{"#13,'Clearance','SweptSolid',(#1060)", "#13,'Profile','SweptSolid',(#1060)", CURVE}, "001", "u"},
        /* It may map several: the best that is a body counts. */
        {{"#13,$,'MappedRepresentation',(#7029,#7022)", "#13,'Box','SweptSolid',(#1060)", CURVE}, "101", "b"},
        {{"#13,$,'MappedRepresentation',(#7025,#7022)", "#13,'','MappedRepresentation',(#7025,#7029)", CURVE},
         "101",
         "b"},
        {{"#13,$,'MappedRepresentation',(#7029,#7025)", "#13,'Body','SweptSolid',(#1060)", CURVE}, "011", "b"},
        /* A body of a type that no reader is known to build takes nothing else out. */
        {{"#13,'Body','SweptSolid',(#7006)", "#13,'Body-FallBack','Brep',(#1060)", CURVE}, "011", "b"},
        {{"#13,'Body','SweptSolid',(#7006)", "#13,'Facetation','Brep',(#1060)", "#13,'Clearance','Brep',(#1060)"},
         "010",
         "b"},
        {{"#13,'Body','SweptSolid',(#7006)", "#13,'Body-FallBack','Brep',(#7006)", CURVE}, "101", "b"},
        {{"#13,'Body','SweptSolid',(#7006)", "#13,'Clearance','Brep',(#1060)", CURVE}, "101", "b"},
        {{"#13,'Body','SweptSolid',(#7006)", "#13,'Body','Brep',(#1060)", CURVE}, "111", "b"},
        {{"#7010,'Body','SweptSolid',(#7006)", "#7011,'Body','Brep',(#1060)", CURVE}, "011", "bl"},
        /* Curves and dimensions of IFC2x3 are no bodies. */
        {{"#13,'Body','GeometricSet',(#7035)", "#13,'Facetation','Brep',(#1060)", CURVE}, "111", "b"},
        {{"#13,'FootPrint','GeometricSet',(#7035)", "#13,'Plan','Curve2D',(#7030,#7032,#7033,#7034)", CURVE},
         "111",
         ""},
        /* The best of several levels of detail stays. */
        {{"#7011,'Body','Brep',(#1060)", "#7010,'Body','Brep',(#1060)", "#7010,'Axis','Curve3D',(#7000)"}, "011", "bl"},
        {{"#7012,'Body','Brep',(#1060)", "#7013,'Body','Brep',(#1060)", "#7011,'Body','Brep',(#1060)"}, "010", "bl"},
        {{"#7013,'Body','Brep',(#1060)", "#7010,'Body','Brep',(#1060)", CURVE}, "011", "bl"},
        {{"#13,'Body','Brep',(#1060)", "#7010,'Body','Brep',(#1060)", "#7011,'Body','Brep',(#1060)"}, "010", "bl"},
        {{"#7014,'Body','Brep',(#1060)", "#7015,'Body','Brep',(#1060)", CURVE}, "101", "bl"},
        {{"#7010,'Body','Brep',(#1060)", "#7010,'Body','CSG',(#1060)", "#7010,'Body','Brep',(#1060)"}, "111", "b"},
        {{"#7010,'Body','Brep',(#1060)", "#7011,'Hull','Brep',(#1060)", CURVE}, "111", "b"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        set_text(&rows[i]);
        open_text();
        apply_edits();
        check_kept(&rows[i]);
        check_flags(&rows[i], 6101);
        check_flags(&rows[i], 6102); /* it shares the shape */
        assert_int_equal(records.edits.n, strchr(rows[i].kept, '0') != NULL);
        ifc_records_close(&records);
    }
}

/* The marks of a product are those of its body alone: here the clearance is 5 km long, and round. */
static void marks_are_those_of_the_body(void **state)
{
    (void)state;
    static const struct row row = {
        {"#13,'Body','SweptSolid',(#1060)", "#13,'Clearance','SweptSolid',(#7100)", CURVE}, "101", "b"};
    set_text(&row);
    char *end = strstr(text, "ENDSEC;\nEND-ISO");
    strcpy(end, "#7100=IFCEXTRUDEDAREASOLID(#7101,#7102,#10,1.);\n#7101=IFCCIRCLEPROFILEDEF(.AREA.,$,#17,70.);\n"
                "#7102=IFCAXIS2PLACEMENT3D(#7103,$,$);\n#7103=IFCCARTESIANPOINT((5000.,0.,0.));\n"
                "ENDSEC;\nEND-ISO-10303-21;\n");
    open_text();
    const struct ifc_product *p = ifc_records_product(&records, 6101);
    assert_true(!p->is_curved && !p->is_far && records.radius_m == 0.0);
    ifc_records_close(&records);
}

/* A representation maps another one 16 times, and that likewise, 12 deep, and the last maps itself: 16 to the power of
 * 12 ways lead through them. Each is looked at once. The body stands at the end. */
static void mapped_ways_are_not_counted(void **state)
{
    (void)state;
    enum { DEPTH = 12, FAN = 16 };
    static char more[1 << 14];
    for (int has = 0; has < 2; has++) {
        size_t n = (size_t)snprintf(more, sizeof more, "#7999=IFCPOLYLINE((#9,#9));\n");
        for (int i = 0; i < DEPTH; i++) {
            const int id = 8000 + 100 * i, to = i + 1 < DEPTH ? id + 100 : id;
            n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCREPRESENTATIONMAP(#12,#%d);\n", id, id + 1);
            n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCSHAPEREPRESENTATION(#13,'Body','Any',(", id + 1);
            for (int k = 0; k < FAN; k++)
                n += (size_t)snprintf(more + n, sizeof more - n, "#%d,", id + 2 + k);
            n += (size_t)snprintf(more + n, sizeof more - n, "#%s));\n", has && i + 1 == DEPTH ? "1060" : "7999");
            for (int k = 0; k < FAN; k++)
                n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCMAPPEDITEM(#%d,#12);\n", id + 2 + k, to);
        }
        snprintf(more + n, sizeof more - n,
                 "#9900=IFCPRODUCTDEFINITIONSHAPE($,$,(#8001));\n"
                 "#9901=IFCWALL('guid_of_fan',#5,'fan',$,$,#1003,#9900,$,$);\n");
        ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, more);
        open_text();
        assert_int_equal(ifc_records_product(&records, 9901)->has_body, has);
        ifc_records_close(&records);
    }
}

/* An analysis model has the shapes of the building a second time, and loads. */
static void analysis_models_are_marked(void **state)
{
    (void)state;
    static const char *const types[] = {"IFCWALL",
                                        "IFCSTRUCTURALSURFACEMEMBER",
                                        "IFCSTRUCTURALSURFACEMEMBERVARYING",
                                        "IFCSTRUCTURALSURFACECONNECTION",
                                        "IFCSTRUCTURALSURFACEACTION",
                                        "IFCSTRUCTURALPLANARACTION",
                                        "IFCSTRUCTURALCURVEMEMBER"};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        char more[256];
        snprintf(more, sizeof more, "#7000=%s('guid_of_it',#5,'it',$,$,#1003,#1002,.SHELL.,0.2);\n", types[i]);
        ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, more);
        open_text();
        const struct ifc_product *p = ifc_records_product(&records, 7000);
        assert_true(p->is_analysis == (i > 0) && p->is_air == (i > 0) && p->has_body);
        ifc_records_close(&records);
    }
}

/* More records: the file ends with them. */
static void add_records(const char *more)
{
    ifc_write_text(text, "IFC4", NULL, NULL, ifc_shapes, 1, more);
}

static void has_edited(const char *want)
{
    open_text();
    apply_edits();
    if (strstr(edited, want) == NULL) fail_msg("no %s in %s", want, strstr(edited, "#7000"));
    ifc_records_close(&records);
}

/* IFC4 ADD2: an index of a triangle is a place in PnIndex, and that gives a place in the list of points. The largest
 * number of a record is 7002 here. */
static void indexed_points_become_a_list(void **state)
{
    (void)state;
#define LIST(more) "#7000=IFCCARTESIANPOINTLIST3D(((0.,0.,0.),\r\n (1.,0.,0.) ,(0.,1.,\n0.),(0.,0.,7.))" more ");\n"
    add_records(LIST("") "#7001=IFCTRIANGULATEDFACESET( #7000 ,$,.F.,((1,2,3)),( 4,1 ,\n3));\n#7002=IFCWALL();\n");
    has_edited("#7003=IFCCARTESIANPOINTLIST3D(((0.,0.,7.),(0.,0.,0.),(0.,1., 0.)));"
               "#7001=IFCTRIANGULATEDFACESET( #7003 ,$,.F.,((1,2,3)),$);\n");
    add_records(
        LIST(",$") "#7001=IFCPOLYGONALFACESET(#7000,.F.,(#7002),(2));\n#7002=IFCINDEXEDPOLYGONALFACE((1,1,1));\n");
    has_edited("#7003=IFCCARTESIANPOINTLIST3D(((1.,0.,0.)),$);#7001=IFCPOLYGONALFACESET(#7003,.F.,(#7002),$);\n");
    /* Two face sets share a list. */
    add_records(LIST("") "#7001=IFCTRIANGULATEDFACESET(#7000,$,$,((1,1,1)),(1));\n"
                         "#7002=IFCTRIANGULATEDFACESET(#7000,$,$,((1,1,1)),(4));\n");
    has_edited("#7003=IFCCARTESIANPOINTLIST3D(((0.,0.,0.)));#7001=IFCTRIANGULATEDFACESET(#7003,$,$,((1,1,1)),$);\n"
               "#7004=IFCCARTESIANPOINTLIST3D(((0.,0.,7.)));#7002=IFCTRIANGULATEDFACESET(#7004,$,$,((1,1,1)),$);\n");
    /* These have no index of points: none at all, an empty one, and the first edition's index of normals. */
    static const char *const plain[] = {"$", "()", "((1,2,3))"};
    for (size_t i = 0; i < sizeof plain / sizeof plain[0]; i++) {
        char more[512];
        snprintf(more, sizeof more, LIST("") "#7001=IFCTRIANGULATEDFACESET(#7000,$,.F.,((1,2,3)),%s);\n", plain[i]);
        add_records(more);
        open_text();
        assert_int_equal(records.edits.n, 0);
        ifc_records_close(&records);
    }
}

/* Face sets use more lists in turn than are kept: list k has the point k alone. */
static void lists_in_turn_keep_apart(void **state)
{
    (void)state;
    enum { LISTS = 6, TURNS = 2 };
    char more[2048], want[128];
    size_t n = 0;
    for (int k = 0; k < LISTS; k++)
        n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCCARTESIANPOINTLIST3D(((%d.,0.,0.))%s);\n", 7000 + k, k,
                              k % 2 ? ",$" : "");
    for (int i = 0; i < LISTS * TURNS; i++)
        n += (size_t)snprintf(more + n, sizeof more - n, "#%d=IFCTRIANGULATEDFACESET(#%d,$,$,((1,1,1)),(1));\n",
                              7100 + i, 7000 + i % LISTS);
    add_records(more);
    for (int i = 0; i < LISTS * TURNS; i++) {
        snprintf(want, sizeof want, "=IFCCARTESIANPOINTLIST3D(((%d.,0.,0.))%s);#%d=IFCTRIANGULATEDFACESET(", i % LISTS,
                 i % LISTS % 2 ? ",$" : "", 7100 + i);
        has_edited(want);
    }
}

static void index_without_a_point_is_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {"5", "0", "-1", "x", "1.5"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char more[512], want[128];
        snprintf(more, sizeof more, LIST("") "#7001=IFCTRIANGULATEDFACESET(#7000,$,.F.,((1,2,3)),(1,2,%s));\n",
                 wrong[i]);
        snprintf(want, sizeof want,
                 "IFCTRIANGULATEDFACESET #7001: PnIndex has %s; allowed 1 to 4, the number of points of #7000",
                 wrong[i]);
        add_records(more);
        assert_int_equal(ifc_records_open(&records, write_text("a.ifc", text), &err), SH_EINPUT);
        if (strstr(err.text, want) == NULL) fail_msg("%s", err.text);
        ifc_records_close(&records);
        unlink(path);
    }
    add_records("#7001=IFCTRIANGULATEDFACESET(#9,$,.F.,((1,2,3)),(1,2,3));\n");
    assert_int_equal(ifc_records_open(&records, write_text("a.ifc", text), &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "its Coordinates are no IFCCARTESIANPOINTLIST3D"));
    ifc_records_close(&records);
    unlink(path);
}

/* IFC 4.3: -2 is a void, -1 a hole, and breaklines are 0 and above. Triangles without a flag stay. */
static void holes_of_a_network_are_left_out(void **state)
{
    (void)state;
    static const struct {
        const char *flags, *left;
    } rows[] = {{"(0,-2,7)", "((1,2,3),(1,4,2))"},
                {"( -1, 0\n,-2)", "((1,3,4))"},
                {"(0,1,2)", "((1,2,3), (1,3,4) ,(1,4,2))"},
                {"(-1)", "((1,3,4),(1,4,2))"},
                {"$", "((1,2,3), (1,3,4) ,(1,4,2))"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char more[512], want[128];
        snprintf(more, sizeof more,
                 LIST("") "#7001=IFCTRIANGULATEDIRREGULARNETWORK(#7000,$,.F.,((1,2,3), (1,3,4) ,(1,4,2)),$,%s);\n",
                 rows[i].flags);
        snprintf(want, sizeof want, "(#7000,$,.F.,%s,$,", rows[i].left);
        add_records(more);
        has_edited(want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bodies_are_chosen),
        cmocka_unit_test(marks_are_those_of_the_body),
        cmocka_unit_test(mapped_ways_are_not_counted),
        cmocka_unit_test(analysis_models_are_marked),
        cmocka_unit_test(indexed_points_become_a_list),
        cmocka_unit_test(lists_in_turn_keep_apart),
        cmocka_unit_test(index_without_a_point_is_refused),
        cmocka_unit_test(holes_of_a_network_are_left_out),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
