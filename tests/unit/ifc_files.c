/* SPDX-License-Identifier: MIT */
#include "tests/unit/ifc_files.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- shapes */

#define EXTRUDED(profile, depth) "50=IFCEXTRUDEDAREASOLID(@51,#12,#10," depth ")\n51=" profile "\n"
#define POINTS \
    "70=IFCCARTESIANPOINTLIST3D(((0.,0.,0.),(4.,0.,0.),(4.,2.,0.),(0.,2.,0.),(0.,0.,1.),(4.,0.,1.),(4.,2.,1.),(0.,2.,1.)))\n"
#define FACE(id, points) \
#id "=IFCFACE((@1" #id "))\n1" #id "=IFCFACEOUTERBOUND(@2" #id ",.T.)\n2" #id "=IFCPOLYLOOP((" points "))\n"
#define CORNERS                                                                                              \
    "71=IFCCARTESIANPOINT((0.,0.,0.))\n72=IFCCARTESIANPOINT((4.,0.,0.))\n73=IFCCARTESIANPOINT((4.,2.,0.))\n" \
    "74=IFCCARTESIANPOINT((0.,2.,0.))\n75=IFCCARTESIANPOINT((0.,0.,1.))\n76=IFCCARTESIANPOINT((4.,0.,1.))\n" \
    "77=IFCCARTESIANPOINT((4.,2.,1.))\n78=IFCCARTESIANPOINT((0.,2.,1.))\n"
/* The points of POINTS from the second on, and an index that finds them. */
#define INDEXED \
    "70=IFCCARTESIANPOINTLIST3D(((9.,9.,9.),(0.,2.,1.),(4.,2.,1.),(4.,0.,1.),(0.,0.,1.),(0.,2.,0.),(4.,2.,0.),(4.,0.,0.),(0.,0.,0.)))\n"
#define PN_INDEX "(9,8,7,6,5,4,3,2)"
#define BREP                                                                                                     \
    "50=IFCFACETEDBREP(@51)\n51=IFCCLOSEDSHELL((@80,@81,@82,@83,@84,@85))\n" CORNERS FACE(80, "@74,@73,@72,@71") \
        FACE(81, "@75,@76,@77,@78") FACE(82, "@71,@72,@76,@75") FACE(83, "@72,@73,@77,@76")                      \
            FACE(84, "@73,@74,@78,@77") FACE(85, "@74,@71,@75,@78")
#define HALF(point, axes)                                                                             \
    IFC_BOX_ROWS "50=IFCBOOLEANCLIPPINGRESULT(.DIFFERENCE.,@60,@51)\n51=IFCHALFSPACESOLID(@52,.F.)\n" \
                 "52=IFCPLANE(@53)\n53=IFCAXIS2PLACEMENT3D(@54," axes ")\n54=IFCCARTESIANPOINT((" point "))\n"
#define MAPPED(operator)                                                         \
    IFC_BOX_ROWS "50=IFCMAPPEDITEM(@51,@53)\n51=IFCREPRESENTATIONMAP(#12,@52)\n" \
                 "52=IFCSHAPEREPRESENTATION(#13,'Body','SolidModel',(@60))\n53=" \
                 operator"\n"                                                    \
                         "54=IFCDIRECTION((-1.,0.,0.))\n55=IFCDIRECTION((0.,1.,0.))\n"

#define PI M_PI
const struct ifc_shape ifc_shapes[IFC_SHAPES] = {
    {"box", "@60", IFC_BOX_ROWS, 28, 8, 0},
    {"cylinder", "@50", EXTRUDED("IFCCIRCLEPROFILEDEF(.AREA.,$,#17,1.)", "2."), 6 * PI, 2 * PI, 1},
    {"ibeam", "@50", EXTRUDED("IFCISHAPEPROFILEDEF(.AREA.,$,#17,0.2,0.3,0.01,0.02,$,$,$)", "3."), 4.1612, 0.0318, 0},
    {"disk", "@50", "50=IFCSWEPTDISKSOLID(@51,0.1,$,$,$)\n51=IFCPOLYLINE((#9,@52))\n52=IFCCARTESIANPOINT((0.,0.,2.))",
     0.42 * PI, 0.02 * PI, 0.1},
    {"turned", "@50",
     "50=IFCREVOLVEDAREASOLID(@51,#12,@54,3.141592653589793)\n51=IFCRECTANGLEPROFILEDEF(.AREA.,$,@52,1.,1.)\n"
     "52=IFCAXIS2PLACEMENT2D(@53,$)\n53=IFCCARTESIANPOINT((2.,0.))\n54=IFCAXIS1PLACEMENT(#9,@55)\n55=IFCDIRECTION((0.,1.,0.))",
     8 * PI + 2, 2 * PI, 2.5},
    {"half space, tilted", "@50",
     HALF("0.,0.,0.5", "@55,@56") "55=IFCDIRECTION((-0.25,0.,1.))\n56=IFCDIRECTION((1.,0.,0.25))",
     /* below z = 0.5 + x / 4: 2 m of slope, sqrt(17) m2, then the top; sides of 0.5 to 1 m */
     8 + 4 + 4.123105625617661 + 1 + 2 + 2 * 3.5, 7, 0},
    {"half space, far", "@50", HALF("5000.,-3000.,0.5", "$,$"), 22, 4, 0},
    {"union", "@50",
     IFC_BOX_ROWS "50=IFCBOOLEANRESULT(.UNION.,@60,@51)\n51=IFCEXTRUDEDAREASOLID(@52,@53,#10,2.)\n" IFC_RECT(52, 1., 1.)
         IFC_AT(53, 54, "2.,1.,0."),
     32, 9, 0},
    {"block", "@50", "50=IFCCSGSOLID(@51)\n51=IFCBLOCK(#12,4.,2.,1.)", 28, 8, 0},
    {"sphere", "@50", "50=IFCCSGSOLID(@51)\n51=IFCSPHERE(#12,1.)", 4 * PI, 4 * PI / 3, 1},
    {"block less cylinder", "@50",
     "50=IFCCSGSOLID(@51)\n51=IFCBOOLEANRESULT(.DIFFERENCE.,@52,@53)\n52=IFCBLOCK(#12,4.,2.,1.)\n"
     "53=IFCRIGHTCIRCULARCYLINDER(@54,1.,0.5)\n" IFC_AT(54, 55, "2.,1.,0."),
     28 + PI / 2, 8 - PI / 4, 0.5},
    {"triangles", "@50",
     POINTS
     "50=IFCTRIANGULATEDFACESET(@70,$,.T.,((4,3,2),(4,2,1),(5,6,7),(5,7,8),(1,2,6),(1,6,5),(2,3,7),(2,7,6),(3,4,8),(3,8,7),(4,1,5),(4,5,8)),$)",
     28, 8, 0},
    {"polygons", "@50",
     POINTS
     "50=IFCPOLYGONALFACESET(@70,.T.,(@51,@52,@53,@54,@55,@56),$)\n51=IFCINDEXEDPOLYGONALFACE((4,3,2,1))\n52=IFCINDEXEDPOLYGONALFACE((5,6,7,8))\n53=IFCINDEXEDPOLYGONALFACE((1,2,6,5))\n54=IFCINDEXEDPOLYGONALFACE((2,3,7,6))\n55=IFCINDEXEDPOLYGONALFACE((3,4,8,7))\n56=IFCINDEXEDPOLYGONALFACE((4,1,5,8))",
     28, 8, 0},
    {"brep", "@50", BREP, 28, 8, 0},
    {"arc", "@50",
     EXTRUDED(
         "IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,@52)",
         "1.") "52=IFCINDEXEDPOLYCURVE(@53,(IFCLINEINDEX((1,2,3)),IFCARCINDEX((3,4,5)),IFCLINEINDEX((5,1))),.F.)\n53=IFCCARTESIANPOINTLIST2D(((0.,0.),(4.,0.),(4.,2.),(2.,4.),(0.,2.)))",
     2 * (8 + 2 * PI) + 8 + 2 * PI, 8 + 2 * PI, 2},
    {"two items", "@50,@52",
     EXTRUDED("IFCRECTANGLEPROFILEDEF(.AREA.,$,#17,1.,1.)",
              "1.") "52=IFCEXTRUDEDAREASOLID(@51,@53,#10,1.)\n" IFC_AT(53, 54, "3.,0.,0."),
     12, 2, 0},
    {"faces that touch", "@50",
     IFC_BOX_ROWS "50=IFCBOOLEANRESULT(.DIFFERENCE.,@60,@51)\n51=IFCEXTRUDEDAREASOLID(@61,@52,#10,0.5)\n" IFC_AT(
         52, 53, "2.,1.,0.5"),
     22, 4, 0},
    {"skew", "@50", "50=IFCEXTRUDEDAREASOLID(@51,#12,@52,1.)\n" IFC_RECT(51, 4., 2.) "52=IFCDIRECTION((0.6,0.,0.8))",
     26.4, 6.4, 0},
    {"open mesh", "@50", POINTS "50=IFCTRIANGULATEDFACESET(@70,$,.F.,((1,2,3),(1,3,4)),$)", 8, 0, 0},
    {"mirrored", "@50", MAPPED("IFCCARTESIANTRANSFORMATIONOPERATOR3D(@54,@55,#9,1.,#10)"), 28, 8, 0},
    {"scaled", "@50", MAPPED("IFCCARTESIANTRANSFORMATIONOPERATOR3DNONUNIFORM(#11,@55,#9,2.,#10,1.,3.)"), 92, 48, 0},
    {"tapered", "@50", "50=IFCEXTRUDEDAREASOLIDTAPERED(@51,#12,#10,1.,@52)\n" IFC_RECT(51, 2., 2.) IFC_RECT(52, 1., 1.),
     5 + 3 * 2.23606797749979 /* sqrt(5) */, 7.0 / 3.0, 0},
    {"cone", "@50", "50=IFCCSGSOLID(@51)\n51=IFCRIGHTCIRCULARCONE(#12,1.,1.)", PI *(1 + M_SQRT2), PI / 3, 1},
    {"pyramid", "@50", "50=IFCCSGSOLID(@51)\n51=IFCRECTANGULARPYRAMID(#12,2.,2.,1.)", 4 + 4 * M_SQRT2, 4.0 / 3.0, 0},
    {"hole in a profile", "@50",
     EXTRUDED(
         "IFCARBITRARYPROFILEDEFWITHVOIDS(.AREA.,$,@52,(@57))",
         "0.1") "52=IFCPOLYLINE((@53,@54,@55,@56,@53))\n53=IFCCARTESIANPOINT((0.,0.))\n54=IFCCARTESIANPOINT((4.,0.))\n55=IFCCARTESIANPOINT((4.,2.5))\n56=IFCCARTESIANPOINT((0.,2.5))\n57=IFCPOLYLINE((@58,@59,@60,@61,@58))\n58=IFCCARTESIANPOINT((1.,0.5))\n59=IFCCARTESIANPOINT((3.,0.5))\n60=IFCCARTESIANPOINT((3.,2.))\n61=IFCCARTESIANPOINT((1.,2.))",
     16, 0.7, 0},
    {"open shell", "@50",
     CORNERS "50=IFCSHELLBASEDSURFACEMODEL((@51))\n51=IFCOPENSHELL((@80))\n" FACE(80, "@75,@76,@77,@78"), 8, 0, 0},
    {"no position", "@50", "50=IFCEXTRUDEDAREASOLID(@51,$,#10,1.)\n" IFC_RECT(51, 4., 2.), 28, 8, 0},
    {"rounded", "@50", EXTRUDED("IFCROUNDEDRECTANGLEPROFILEDEF(.AREA.,$,#17,4.,2.,0.5)", "1."),
     2 * (7 + PI / 4) + 8 + PI, 7 + PI / 4, 0.5},
    {"hollow", "@50", EXTRUDED("IFCRECTANGLEHOLLOWPROFILEDEF(.AREA.,$,#17,4.,2.,0.1,$,$)", "1."), 25.52, 1.16, 0},
    {"angle", "@50", EXTRUDED("IFCLSHAPEPROFILEDEF(.AREA.,$,#17,2.,1.,0.1,$,$,$,$,$)", "1."), 6.58, 0.29, 0},
    {"trimmed", "@50",
     EXTRUDED(
         "IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,@52)",
         "1.") "52=IFCCOMPOSITECURVE((@53,@54),.F.)\n53=IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,@55)\n54=IFCCOMPOSITECURVESEGMENT(.CONTINUOUS.,.T.,@60)\n55=IFCPOLYLINE((@56,@57,@58,@59))\n56=IFCCARTESIANPOINT((0.,1.))\n57=IFCCARTESIANPOINT((0.,0.))\n58=IFCCARTESIANPOINT((4.,0.))\n59=IFCCARTESIANPOINT((4.,1.))\n60=IFCTRIMMEDCURVE(@61,(IFCPARAMETERVALUE(0.)),(IFCPARAMETERVALUE(3.141592653589793)),.T.,.PARAMETER.)\n61=IFCCIRCLE(@62,2.)\n62=IFCAXIS2PLACEMENT2D(@63,$)\n63=IFCCARTESIANPOINT((2.,1.))",
     2 * (4 + 2 * PI) + 6 + 2 * PI, 4 + 2 * PI, 2},
    {"indexed triangles", "@50",
     INDEXED
     "50=IFCTRIANGULATEDFACESET(@70,$,.T.,((4,3,2),(4,2,1),(5,6,7),(5,7,8),(1,2,6),(1,6,5),(2,3,7),(2,7,6),(3,4,8),(3,8,7),(4,1,5),(4,5,8))," PN_INDEX
     ")",
     28, 8, 0},
    {"indexed polygons", "@50",
     INDEXED
     "50=IFCPOLYGONALFACESET(@70,.T.,(@51,@52,@53,@54,@55,@56)," PN_INDEX
     ")\n51=IFCINDEXEDPOLYGONALFACE((4,3,2,1))\n52=IFCINDEXEDPOLYGONALFACE((5,6,7,8))\n53=IFCINDEXEDPOLYGONALFACE((1,2,6,5))\n54=IFCINDEXEDPOLYGONALFACE((2,3,7,6))\n55=IFCINDEXEDPOLYGONALFACE((3,4,8,7))\n56=IFCINDEXEDPOLYGONALFACE((4,1,5,8))",
     28, 8, 0},
    {"holes in triangles", "@50",
     INDEXED "50=IFCTRIANGULATEDIRREGULARNETWORK(@70,$,.F.,((5,6,7),(5,7,8),(5,6,8))," PN_INDEX ",(-1,3,-2))", 4, 0, 0},
};

/* ---- files */

static char *at;

static void put(const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    at += vsprintf(at, format, ap);
    va_end(ap);
}

/* Local numbers become global ones. */
static void put_local(const char *text, size_t base)
{
    for (const char *p = text; *p != '\0'; p++) {
        if (*p == '@')
            put("#%zu", base + strtoul(p + 1, (char **)&p, 10)), p--;
        else
            *at++ = *p;
    }
}

static void put_records(const char *records, size_t base)
{
    for (const char *p = records; *p != '\0';) {
        const size_t n = strcspn(p, "\n");
        char line[2048];
        snprintf(line, sizeof line, "@%.*s;\n", (int)n, p);
        put_local(line, base);
        p += n + (p[n] == '\n');
    }
}

static void put_shape(const struct ifc_shape *shape, const char *type, size_t i)
{
    const size_t base = 1000 * (i + 1);
    put_records(shape->records, base);
    put("#%zu=IFCSHAPEREPRESENTATION(#13,'Body','SolidModel',(", base + 1);
    put_local(shape->items, base);
    put("));\n#%zu=IFCPRODUCTDEFINITIONSHAPE($,$,(#%zu));\n", base + 2, base + 1);
    put("#%zu=IFCLOCALPLACEMENT(#19,#12);\n", base + 3);
    put("#%zu=%s('guid_of_product__%05zu',#5,'%s',$,$,#%zu,#%zu,$%s);\n", base, type, i, shape->name, base + 3,
        base + 2, strcmp(type, "IFCWALL") == 0 ? "" : ",$");
    put("#%zu=IFCRELCONTAINEDINSPATIALSTRUCTURE('guid_of_relation_%05zu',#5,$,$,(#%zu),#20);\n", base + 4, i, base);
}

void ifc_write_text(char *text, const char *schema, const char *unit, const char *placed, const struct ifc_shape *shape,
                    size_t n, const char *more)
{
    at = text;
    put("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('a','2020-01-01T00:00:00',(''),(''),'','','');\n"
        "FILE_SCHEMA(('%s'));\nENDSEC;\nDATA;\n#1=IFCPERSON($,'a',$,$,$,$,$,$);\n#2=IFCORGANIZATION($,'a',$,$,$);\n"
        "#3=IFCPERSONANDORGANIZATION(#1,#2,$);\n#4=IFCAPPLICATION(#2,'1','a','a');\n"
        "#5=IFCOWNERHISTORY(#3,#4,$,.ADDED.,$,$,$,0);\n#6=%s;\n#7=IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.);\n"
        "#8=IFCUNITASSIGNMENT((#6,#7));\n#9=IFCCARTESIANPOINT((0.,0.,0.));\n#10=IFCDIRECTION((0.,0.,1.));\n"
        "#11=IFCDIRECTION((1.,0.,0.));\n#12=IFCAXIS2PLACEMENT3D(#9,#10,#11);\n",
        schema, unit != NULL ? unit : "IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)");
    put("#13=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#12,$);\n#14=IFCPROJECT('guid_of_project_000000',#5,'p',$,$,$,"
        "$,(#13),#8);\n#15=IFCRELAGGREGATES('guid_of_aggregate_0000',#5,$,$,#14,(#20));\n#16=IFCCARTESIANPOINT((0.,0.));\n"
        "#17=IFCAXIS2PLACEMENT2D(#16,$);\n#18=IFCCARTESIANPOINT((%s));\n#19=IFCLOCALPLACEMENT($,#21);\n"
        "#20=IFCSITE('guid_of_site_000000000',#5,'site',$,$,#19,$,$,.ELEMENT.,$,$,$,$,$);\n"
        "#21=IFCAXIS2PLACEMENT3D(#18,#10,#11);\n",
        placed != NULL ? placed : "0.,0.,0.");
    for (size_t i = 0; i < n; i++)
        put_shape(&shape[i], strcmp(schema, "IFC2X3") == 0 ? "IFCWALL" : "IFCBUILDINGELEMENTPROXY", i);
    put("%sENDSEC;\nEND-ISO-10303-21;\n", more != NULL ? more : "");
}
