"""Every element and attribute of SSP 1.0 and 2.0, and what becomes of it: the data behind "never silence".

Each is read, or named here as without influence on the result, or refused with a reason.  What stands nowhere
here is refused by name and line; an attribute of a foreign namespace is warned about.
Source: the XML schemas of SSP 1.0 and 2.0 (SystemStructure{Common,Description,ParameterValues,
ParameterMapping,SignalDictionary}.xsd), Modelica Association.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

NAMESPACES = {
    "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary",
    "",  # files that state no namespace at all
}
SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"  # its attributes are for validators


@dataclass(frozen=True)
class Form:
    """One kind of element; names separated by blanks.

    read      attributes that are honoured; a "!" behind a name: it must be there
    idle      attributes without influence on the result
    children  elements that are honoured
    ignored   elements without influence on the result
    refused   attributes and elements that are refused, and why
    new       which of the names above SSP 2.0 added to 1.0
    """

    read: str = ""
    idle: str = ""
    children: str = ""
    ignored: str = ""
    refused: Mapping[str, str] = field(default_factory=dict)
    new: str = ""


REALS = "Real Float64 Float32"
INTEGERS = "Integer Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64"
VALUE_TYPES = f"{REALS} {INTEGERS} Boolean String Enumeration Binary"
TYPES = f"{VALUE_TYPES} Clock"
NEW_VALUE_TYPES = "Float64 Float32 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Dimension"
NEW_TYPES = f"{NEW_VALUE_TYPES} Clock"
TRANSFORMATIONS = (
    "LinearTransformation BooleanMappingTransformation IntegerMappingTransformation "
    "EnumerationMappingTransformation"
)
NEW_KINDS = ("structuralParameter", "constant", "local", "unspecified")
KINDS = ("input", "output", "parameter", "calculatedParameter", "inout", *NEW_KINDS)

_BASE = "description"  # `id` counts where something can refer to it
_META = "author fileversion copyright license generationTool generationDateAndTime"
_EXTRA = "Annotations MetaData Signature"
_SINGLE = "connections and values of single elements of an array are not supported"

FORMS: dict[str, Form] = {
    # ---- SystemStructureDescription (chapter 5) ----
    "ssd:SystemStructureDescription": Form(
        "version! name",
        f"id {_BASE} {_META}",
        "System Enumerations Units DefaultExperiment Annotations SSDVariant",
        "MetaData Signature",
        new="SSDVariant MetaData Signature",
    ),
    "ssd:SSDVariant": Form("", f"id {_BASE} name baseSSD kind"),  # its presence is warned about
    "ssd:DefaultExperiment": Form("startTime stopTime", "", "", "Annotations"),
    "ssd:System": Form(
        "name id",
        _BASE,
        "Connectors ParameterBindings Elements Connections SignalDictionaries",
        f"ElementGeometry SystemGeometry GraphicalElements {_EXTRA}",
        new="MetaData Signature",
    ),
    "ssd:Elements": Form(children="Component System SignalDictionaryReference"),
    "ssd:Component": Form(
        "name! type source implementation",
        f"id {_BASE}",
        "Connectors ParameterBindings",
        f"ElementGeometry {_EXTRA}",
        new="MetaData Signature",
    ),
    "ssd:SignalDictionaryReference": Form(
        "name! dictionary!",
        f"id {_BASE}",
        "Connectors",
        f"ElementGeometry {_EXTRA}",
        {"ParameterBindings": "a signal dictionary has no parameters"},
        new="MetaData Signature",
    ),
    "ssd:Connectors": Form(children="Connector"),
    "ssd:Connector": Form(
        "name! kind!", f"id {_BASE}", f"{TYPES} Dimension", f"ConnectorGeometry {_EXTRA}", new=NEW_TYPES
    ),
    "ssd:Connections": Form(children="Connection"),
    "ssd:Connection": Form(
        "startElement startConnector! endElement endConnector! suppressUnitConversion",
        f"id {_BASE}",
        TRANSFORMATIONS,
        f"ConnectionGeometry {_EXTRA}",
        {"startIndices": _SINGLE, "endIndices": _SINGLE},
    ),
    "ssd:SignalDictionaries": Form(children="SignalDictionary"),
    "ssd:SignalDictionary": Form("name! type source", f"id {_BASE}", "SignalDictionary", _EXTRA),
    "ssd:ParameterBindings": Form(children="ParameterBinding"),
    "ssd:ParameterBinding": Form(
        "type source sourceBase prefix", f"id {_BASE}", "ParameterValues ParameterMapping", _EXTRA
    ),
    "ssd:ParameterValues": Form(children="ParameterSet"),
    "ssd:ParameterMapping": Form("type source sourceBase", f"id {_BASE}", "ParameterMapping", _EXTRA),
    # ---- SystemStructureCommon (chapter 4) ----
    "ssc:Enumerations": Form(children="Enumeration"),
    "ssc:Enumeration": Form("name!", f"id {_BASE}", "Item", "Annotations"),
    "ssc:Item": Form("name! value!"),
    "ssc:Units": Form(children="Unit"),
    "ssc:Unit": Form("name!", f"id {_BASE}", "BaseUnit", "Annotations"),
    "ssc:BaseUnit": Form("kg m s A K mol cd rad factor offset"),
    "ssc:Dimension": Form("size sizeConnector"),
    "ssc:LinearTransformation": Form("factor offset"),
    "ssc:BooleanMappingTransformation": Form(children="MapEntry"),
    "ssc:IntegerMappingTransformation": Form(children="MapEntry"),
    "ssc:EnumerationMappingTransformation": Form(children="MapEntry"),
    "ssc:MapEntry": Form("source! target!"),
    **{f"ssc:{name}": Form("unit") for name in REALS.split()},
    **{f"ssc:{name}": Form() for name in f"{INTEGERS} Boolean String".split()},
    "ssc:Enumeration type": Form("name!"),
    "ssc:Binary": Form("mime-type"),
    "ssc:Clock": Form(
        "intervalVariability",  # the FMU states when its clock ticks: these can only repeat it
        "intervalDecimal shiftDecimal supportsFraction resolution intervalCounter shiftCounter priority",
    ),
    # ---- SystemStructureParameterValues (chapter 6) ----
    "ssv:ParameterSet": Form(
        "version!",
        f"name id {_BASE} {_META}",
        "Parameters Units Enumerations",
        _EXTRA,
        new="MetaData Signature",
    ),
    "ssv:Parameters": Form(children="Parameter"),
    "ssv:Parameter": Form("name!", f"id {_BASE}", f"{VALUE_TYPES} Dimension", _EXTRA, new=NEW_VALUE_TYPES),
    **{f"ssv:{name}": Form("value! unit") for name in REALS.split()},
    **{f"ssv:{name}": Form("value!") for name in f"{INTEGERS} Boolean".split()},
    "ssv:String": Form("value", "", "Value", new="Value"),
    "ssv:Enumeration": Form("value name", "", "Value", new="Value"),
    "ssv:Binary": Form("value", "mime-type", "Value", new="Value"),
    "ssv:Value": Form("value"),
    # ---- SystemStructureParameterMapping (chapter 7) ----
    "ssm:ParameterMapping": Form("version!", f"id {_BASE} {_META}", "MappingEntry", _EXTRA),
    "ssm:MappingEntry": Form(
        "source! target! suppressUnitConversion", f"id {_BASE}", TRANSFORMATIONS, "Annotations"
    ),
    # ---- SystemStructureSignalDictionary (chapter 8) ----
    "ssb:SignalDictionary": Form(
        "version!", f"name id {_BASE} {_META}", "DictionaryEntry Enumerations Units", _EXTRA
    ),
    "ssb:DictionaryEntry": Form("name!", f"id {_BASE}", f"{TYPES} Dimension", _EXTRA, new=NEW_TYPES),
}
