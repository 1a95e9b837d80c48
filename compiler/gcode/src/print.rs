//! Expressions back to text.

use std::fmt::{self, Write};

use crate::model::*;

impl Scan {
    /// An expression as a program would write it: `[1 + 2]`, `#<width>`, `SIN[30]`. Binary operations always
    /// stand in brackets, so that the text can follow a letter and reads back to the same tree.
    pub fn expr_text(&self, expr: ExprId) -> String {
        let mut out = String::new();
        // Writing to a string can't fail.
        let _ = self.write_value(&mut out, expr);
        out
    }

    fn write_value(&self, out: &mut String, expr: ExprId) -> fmt::Result {
        match self.nodes[expr.0 as usize] {
            Node::Number(value) => write!(out, "{value}"),
            Node::Param(number) => {
                out.push('#');
                self.write_value(out, number)
            }
            Node::Named(name) => write!(out, "#<{}>", self.names[name as usize]),
            Node::Unary(Unary::Negate, value) => {
                // In front of a literal the sign would become part of the number.
                if matches!(self.nodes[value.0 as usize], Node::Number(_)) {
                    out.push_str("-[");
                    self.write_value(out, value)?;
                    out.push(']');
                    return Ok(());
                }
                out.push('-');
                self.write_value(out, value)
            }
            Node::Unary(function, value) => {
                out.push_str(function.name());
                self.write_bracketed(out, value)
            }
            Node::Atan(y, x) => {
                out.push_str("ATAN");
                self.write_bracketed(out, y)?;
                out.push('/');
                self.write_bracketed(out, x)
            }
            Node::ExistsNamed(name) => write!(out, "EXISTS[#<{}>]", self.names[name as usize]),
            Node::ExistsParam(number) => {
                out.push_str("EXISTS[#");
                self.write_value(out, number)?;
                out.push(']');
                Ok(())
            }
            Node::Binary(..) => self.write_bracketed(out, expr),
            Node::Bad => {
                out.push('?');
                Ok(())
            }
        }
    }

    fn write_bracketed(&self, out: &mut String, expr: ExprId) -> fmt::Result {
        out.push('[');
        if let Node::Binary(operator, left, right) = self.nodes[expr.0 as usize] {
            self.write_value(out, left)?;
            write!(out, " {} ", operator.name())?;
            self.write_value(out, right)?;
        } else {
            self.write_value(out, expr)?;
        }
        out.push(']');
        Ok(())
    }

    /// A setting as a program would write it.
    pub fn setting_text(&self, setting: &Setting) -> String {
        let target = match setting.target {
            Target::Number(number) => format!("#{}", self.expr_text(number)),
            Target::Named(name) => format!("#<{}>", self.names[name as usize]),
        };
        format!("{target} = {}", self.expr_text(setting.value))
    }
}

impl Unary {
    /// Upper-case name; `-` for the minus sign.
    pub fn name(self) -> &'static str {
        match self {
            Unary::Negate => "-",
            Unary::Abs => "ABS",
            Unary::Acos => "ACOS",
            Unary::Asin => "ASIN",
            Unary::Cos => "COS",
            Unary::Exp => "EXP",
            Unary::Fix => "FIX",
            Unary::Fup => "FUP",
            Unary::Ln => "LN",
            Unary::Round => "ROUND",
            Unary::Sin => "SIN",
            Unary::Sqrt => "SQRT",
            Unary::Tan => "TAN",
        }
    }
}

impl Binary {
    /// As in a program, upper case.
    pub fn name(self) -> &'static str {
        match self {
            Binary::Power => "**",
            Binary::Times => "*",
            Binary::Divide => "/",
            Binary::Modulo => "MOD",
            Binary::Plus => "+",
            Binary::Minus => "-",
            Binary::Eq => "EQ",
            Binary::Ne => "NE",
            Binary::Gt => "GT",
            Binary::Ge => "GE",
            Binary::Lt => "LT",
            Binary::Le => "LE",
            Binary::And => "AND",
            Binary::Or => "OR",
            Binary::Xor => "XOR",
        }
    }
}

impl Keyword {
    /// As in a program, lower case; empty for a bare O-word.
    pub fn name(self) -> &'static str {
        match self {
            Keyword::Sub => "sub",
            Keyword::Endsub => "endsub",
            Keyword::Call => "call",
            Keyword::Do | Keyword::MacroDo => "do",
            Keyword::While | Keyword::MacroWhile => "while",
            Keyword::Endwhile => "endwhile",
            Keyword::If | Keyword::MacroIfGoto | Keyword::MacroIfThen => "if",
            Keyword::Elseif => "elseif",
            Keyword::Else => "else",
            Keyword::Endif => "endif",
            Keyword::Break => "break",
            Keyword::Continue => "continue",
            Keyword::Return => "return",
            Keyword::Repeat => "repeat",
            Keyword::Endrepeat => "endrepeat",
            Keyword::Program => "",
            Keyword::MacroGoto => "goto",
            Keyword::MacroEnd => "end",
        }
    }
}
