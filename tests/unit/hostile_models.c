/* SPDX-License-Identifier: MIT */
#include "tests/unit/hostile_models.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MODELS "/usr/share/assimp/models/"

/* The model has a wall with an opening, a body of faces, and the records that an IFC needs around them. The only IFC of
 * Assimp's models is a house of 4 MB, too large to be read hundreds of times. */
static const char IFC[] =
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    "FILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n"
    "#1=IFCCARTESIANPOINT((0.,0.,0.));\n#2=IFCDIRECTION((0.,0.,1.));\n#3=IFCDIRECTION((1.,0.,0.));\n"
    "#4=IFCAXIS2PLACEMENT3D(#1,#2,#3);\n#5=IFCLOCALPLACEMENT($,#4);\n"
    "#6=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,#4,$);\n"
    "#7=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);\n#8=IFCUNITASSIGNMENT((#7));\n"
    "#9=IFCPERSON($,'p',$,$,$,$,$,$);\n#10=IFCORGANIZATION($,'o',$,$,$);\n"
    "#11=IFCPERSONANDORGANIZATION(#9,#10,$);\n#12=IFCAPPLICATION(#10,'1','a','a');\n"
    "#13=IFCOWNERHISTORY(#11,#12,$,.ADDED.,$,$,$,0);\n"
    "#14=IFCPROJECT('0YvctVUKr0kugbFTf53O9L',#13,'p',$,$,$,$,(#6),#8);\n"
    "#15=IFCSITE('0YvctVUKr0kugbFTf53O91',#13,'site',$,$,#5,$,$,.ELEMENT.,$,$,$,$,$);\n"
    "#16=IFCRELAGGREGATES('0YvctVUKr0kugbFTf53O92',#13,$,$,#14,(#15));\n"
    "#17=IFCCARTESIANPOINT((0.,0.));\n#18=IFCAXIS2PLACEMENT2D(#17,$);\n"
    "#19=IFCRECTANGLEPROFILEDEF(.AREA.,$,#18,4.,0.3);\n#20=IFCEXTRUDEDAREASOLID(#19,#4,#2,2.5);\n"
    "#21=IFCSHAPEREPRESENTATION(#6,'Body','SweptSolid',(#20));\n#22=IFCPRODUCTDEFINITIONSHAPE($,$,(#21));\n"
    "#23=IFCWALLSTANDARDCASE('0YvctVUKr0kugbFTf53O93',#13,'wall',$,$,#5,#22,$);\n"
    "#24=IFCRELCONTAINEDINSPATIALSTRUCTURE('0YvctVUKr0kugbFTf53O94',#13,$,$,(#23,#51),#15);\n"
    "#25=IFCCARTESIANPOINT((-0.5,-0.3));\n#26=IFCCARTESIANPOINT((0.5,-0.3));\n"
    "#27=IFCCARTESIANPOINT((0.5,0.3));\n#28=IFCCARTESIANPOINT((-0.5,0.3));\n"
    "#29=IFCPOLYLINE((#25,#26,#27,#28,#25));\n#30=IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,#29);\n"
    "#31=IFCCARTESIANPOINT((0.,0.,1.));\n#32=IFCAXIS2PLACEMENT3D(#31,#2,#3);\n"
    "#33=IFCEXTRUDEDAREASOLID(#30,#32,#2,1.);\n#34=IFCSHAPEREPRESENTATION(#6,'Body','SweptSolid',(#33));\n"
    "#35=IFCPRODUCTDEFINITIONSHAPE($,$,(#34));\n"
    "#36=IFCOPENINGELEMENT('0YvctVUKr0kugbFTf53O95',#13,'hole',$,$,#5,#35,$);\n"
    "#37=IFCRELVOIDSELEMENT('0YvctVUKr0kugbFTf53O96',#13,$,$,#23,#36);\n"
    "#38=IFCCARTESIANPOINT((0.,0.,5.));\n#39=IFCCARTESIANPOINT((1.,0.,5.));\n"
    "#40=IFCCARTESIANPOINT((0.,1.,5.));\n#41=IFCCARTESIANPOINT((0.,0.,6.));\n"
    "#42=IFCPOLYLOOP((#38,#39,#40));\n#43=IFCFACEOUTERBOUND(#42,.T.);\n#44=IFCFACE((#43));\n"
    "#45=IFCPOLYLOOP((#38,#39,#41));\n#46=IFCFACEOUTERBOUND(#45,.T.);\n#47=IFCFACE((#46));\n"
    "#48=IFCCLOSEDSHELL((#44,#47));\n#49=IFCFACETEDBREP(#48);\n"
    "#50=IFCSHAPEREPRESENTATION(#6,'Body','Brep',(#49));\n#52=IFCPRODUCTDEFINITIONSHAPE($,$,(#50));\n"
    "#51=IFCBUILDINGELEMENTPROXY('0YvctVUKr0kugbFTf53O97',#13,'body',$,$,#5,#52,$,$);\n"
    "ENDSEC;\nEND-ISO-10303-21;\n";

static const char STL[] = "solid hall\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0.5\nvertex 0 1 0\n"
                          "endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0.5\nvertex 1 1 0\n"
                          "vertex 0 1 0\nendloop\nendfacet\nendsolid hall\n";

/* text: the model itself, where it is in this file; file: where it is in the package. */
static const struct {
    const char *format, *ending, *file, *text;
} SOURCES[] = {
    {"IFC", ".ifc", NULL, IFC},
    {"FBX", ".fbx", MODELS "FBX/phong_cube.fbx", NULL},
    {"FBX", ".fbx", MODELS "FBX/box.fbx", NULL},
    {"FBX", ".fbx", MODELS "FBX/boxWithCompressedCTypeArray.FBX", NULL},
    {"Collada", ".dae", MODELS "Collada/cube_triangulate.dae", NULL},
    {"Collada", ".dae", MODELS "Collada/ConcavePolygon.dae", NULL},
    {"Collada", ".dae", MODELS "Collada/cube_tristrips.dae", NULL},
    {"glTF", ".gltf", MODELS "glTF2/BoxTextured-glTF-Embedded/BoxTextured.gltf", NULL},
    {"glTF", ".glb", MODELS "glTF2/BoxTextured-glTF-Binary/BoxTextured.glb", NULL},
    {"STL", ".stl", NULL, STL},
    {"STL", ".stl", NULL, NULL}, /* binary */
};
enum { MODELS_N = sizeof SOURCES / sizeof SOURCES[0] };

static const char *const FORMATS[HOSTILE_FORMATS] = {"IFC", "FBX", "Collada", "glTF", "STL"};
static struct hostile_model model[MODELS_N];

const char *hostile_format(int format)
{
    return FORMATS[format];
}

static int take(struct hostile_model *m, const void *bytes, size_t n)
{
    m->bytes = malloc(n);
    m->n = n;
    if (m->bytes == NULL) return 0;
    memcpy(m->bytes, bytes, n);
    return 1;
}

static int take_file(struct hostile_model *m, const char *path)
{
    static char bytes[1 << 16];
    FILE *f = fopen(path, "rb");
    if (f == NULL) return 0;
    size_t n = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    return n > 0 && n < sizeof bytes && take(m, bytes, n);
}

/* Eight triangles of a binary STL. */
static int take_binary_stl(struct hostile_model *m)
{
    char bytes[84 + 8 * 50] = "binary";
    const uint32_t n = 8;
    memcpy(bytes + 80, &n, 4);
    for (uint32_t i = 0; i < n; i++) {
        const float v[12] = {0, 0, 1, (float)i, 0, 0, (float)i + 1, 0, 0, (float)i, 1, 0.5f};
        memcpy(bytes + 84 + 50 * i, v, sizeof v);
    }
    return take(m, bytes, sizeof bytes);
}

int hostile_models_open(void)
{
    for (int i = 0; i < MODELS_N; i++) {
        model[i].ending = SOURCES[i].ending;
        int done = SOURCES[i].text != NULL   ? take(&model[i], SOURCES[i].text, strlen(SOURCES[i].text))
                   : SOURCES[i].file != NULL ? take_file(&model[i], SOURCES[i].file)
                                             : take_binary_stl(&model[i]);
        if (!done) return 0;
    }
    return 1;
}

void hostile_models_close(void)
{
    for (int i = 0; i < MODELS_N; i++) {
        free(model[i].bytes);
        model[i].bytes = NULL;
    }
}

const struct hostile_model *hostile_model(uint64_t number)
{
    const char *format = FORMATS[number % HOSTILE_FORMATS];
    uint64_t nth = number / HOSTILE_FORMATS;
    int first = 0, n = 0;
    while (strcmp(SOURCES[first].format, format) != 0)
        first++;
    while (first + n < MODELS_N && strcmp(SOURCES[first + n].format, format) == 0)
        n++;
    return &model[first + (int)(nth % (uint64_t)n)];
}
